"""All numbers of what surrounds the robot's decisions, a field for each room: recordings and files of results.

The mapper imports :class:`pipeline.config.PipelineConfig`, and these rooms import the mapper: hence a second tree.
"""

from dataclasses import dataclass

from pipeline.datasets.config import DatasetsConfig
from pipeline.rerun.config import RerunConfig
from pipeline.rescue_report.config import RescueReportConfig


@dataclass(frozen=True)
class IoConfig:
    """The numbers of these rooms; a run writes them into config.yaml, and ``--config`` changes any of them."""

    datasets: DatasetsConfig = DatasetsConfig()
    rerun: RerunConfig = RerunConfig()
    rescue_report: RescueReportConfig = RescueReportConfig()
