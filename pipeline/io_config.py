"""All parameters for reading recordings and writing results, one field per package.

These parameters are not part of :class:`pipeline.config.PipelineConfig`, because the mapper imports that class, and
the packages with these parameters import the mapper.
"""

from dataclasses import dataclass

from pipeline.datasets.config import DatasetsConfig
from pipeline.rerun.config import RerunConfig
from pipeline.rescue_report.config import RescueReportConfig


@dataclass(frozen=True)
class IoConfig:
    """The parameters of input and output; a run writes them to config.yaml, and ``--config`` changes any of them."""

    datasets: DatasetsConfig = DatasetsConfig()
    rerun: RerunConfig = RerunConfig()
    rescue_report: RescueReportConfig = RescueReportConfig()
