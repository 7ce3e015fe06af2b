"""All configurable parameters of the robot's software, one field per package."""

from dataclasses import dataclass

from pipeline.elevation_map.config import ElevationConfig
from pipeline.errors import InputError, require_at_least
from pipeline.exploration.config import ExplorationConfig
from pipeline.localisation.config import LocalisationConfig
from pipeline.metric_map.config import MetricMapConfig
from pipeline.navigation.config import NavigationConfig
from pipeline.segments.config import SegmentsConfig
from pipeline.semantic_map.config import SemanticMapConfig
from pipeline.topological_map.config import MAX_SIGHT_CELLS, TopologicalMapConfig
from pipeline.tracks.config import TracksConfig
from pipeline.victims.config import VictimsConfig


@dataclass(frozen=True)
class KeyframesConfig:
    """When corrected keyframe poses are applied to the maps.

    Attributes:
        min_displacement: displacement in a keyframe's view, m, above which the keyframe gets a new pose in the maps,
            as in RTAB-Map.
        correction_threshold: displacement in any keyframe's view, m, above which the maps are corrected during a
            drive. The default is a fifth of a voxel, because each new estimate of the odometry's scale moves most
            keyframes slightly.
    """

    min_displacement: float = 0.01
    correction_threshold: float = 0.02

    def __post_init__(self) -> None:
        require_at_least(0, "keyframes", self, "min_displacement", "correction_threshold")


@dataclass(frozen=True)
class ExplorerConfig:
    """When the explorer gives up.

    Attributes:
        max_failed_drives: number of failed drives from the same position after which the robot stays there.
        min_drive_distance: distance from its start beyond which a drive is not considered failed, m.
    """

    max_failed_drives: int = 5
    min_drive_distance: float = 0.3

    def __post_init__(self) -> None:
        require_at_least(1, "explorer", self, "max_failed_drives")
        require_at_least(0, "explorer", self, "min_drive_distance")


@dataclass(frozen=True)
class PipelineConfig:
    """The parameters of all packages; a run writes them to config.yaml, and ``--config`` changes any of them."""

    localisation: LocalisationConfig = LocalisationConfig()
    keyframes: KeyframesConfig = KeyframesConfig()
    metric_map: MetricMapConfig = MetricMapConfig()
    elevation_map: ElevationConfig = ElevationConfig()
    semantic_map: SemanticMapConfig = SemanticMapConfig()
    segments: SegmentsConfig = SegmentsConfig()
    victims: VictimsConfig = VictimsConfig()
    tracks: TracksConfig = TracksConfig()
    topological_map: TopologicalMapConfig = TopologicalMapConfig()
    exploration: ExplorationConfig = ExplorationConfig()
    navigation: NavigationConfig = NavigationConfig()
    explorer: ExplorerConfig = ExplorerConfig()

    def __post_init__(self) -> None:
        cell, sight = self.elevation_map.cell, self.topological_map.sight
        if not sight / cell <= MAX_SIGHT_CELLS:
            raise InputError(
                f"topological_map.sight = {sight:g}: must be at most {MAX_SIGHT_CELLS} times "
                f"elevation_map.cell = {cell:g}; reduce the sight or enlarge the cells"
            )
