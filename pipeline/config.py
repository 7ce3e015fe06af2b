"""All numbers of the robot's software that one may change, a field for each room."""

from dataclasses import dataclass

from pipeline.localisation.config import LocalisationConfig
from pipeline.navigation.config import NavigationConfig


@dataclass(frozen=True)
class ExplorerConfig:
    """When the robot gives up.

    Attributes:
        patience: failed drives from one place after which the robot stays.
        got_away: m; a drive that led farther from the place was no failure.
    """

    patience: int = 5
    got_away: float = 0.3


@dataclass(frozen=True)
class PipelineConfig:
    """The numbers of all rooms; a run writes them into config.yaml, and ``--config`` changes any of them."""

    localisation: LocalisationConfig = LocalisationConfig()
    navigation: NavigationConfig = NavigationConfig()
    explorer: ExplorerConfig = ExplorerConfig()
