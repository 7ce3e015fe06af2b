"""All parameters of reading recordings and writing results, a field for each package.

They are not part of :class:`pipeline.config.PipelineConfig`, because the mapper imports that, and these packages
import the mapper.
"""

from dataclasses import dataclass

from pipeline.datasets.config import DatasetsConfig
from pipeline.rerun.config import RerunConfig
from pipeline.rescue_report.config import RescueReportConfig


@dataclass(frozen=True)
class IoConfig:
    """The parameters of these packages; a run writes them to config.yaml, and ``--config`` changes any of them."""

    datasets: DatasetsConfig = DatasetsConfig()
    rerun: RerunConfig = RerunConfig()
    rescue_report: RescueReportConfig = RescueReportConfig()
