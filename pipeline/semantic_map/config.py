"""Parameters of the semantic map: how points are classified, and the resolution at which their classes are stored."""

from dataclasses import dataclass
from math import radians

from pipeline.errors import InputError, require_at_least, require_positive


@dataclass(frozen=True)
class RuleConfig:
    """How the baseline classifies points by height, slope and roughness.

    Attributes:
        wall_tilt: minimum tilt of a wall, rad.
        min_deck_height: minimum height of a deck, m, above the ground where the robot was set down.
        min_ceiling_height: minimum height of a ceiling, m, above the ground where the robot was set down.
    """

    wall_tilt: float = radians(60)
    min_deck_height: float = 0.08
    min_ceiling_height: float = 2.0

    def __post_init__(self) -> None:
        require_positive("semantic_map.rules", self, "wall_tilt", "min_deck_height")
        if self.min_ceiling_height <= self.min_deck_height:
            raise InputError(
                f"semantic_map.rules.min_ceiling_height = {self.min_ceiling_height}: must be greater than "
                f"min_deck_height = {self.min_deck_height}"
            )


@dataclass(frozen=True)
class NetworkConfig:
    """How a network classifies a frame.

    Attributes:
        grids: number of grids of columns, shifted relative to each other; class probabilities are averaged over them.
        plane_weight: weight of the mean log probabilities of a plane's points; a point's own log probabilities have
            the weight 1.
    """

    grids: int = 3
    plane_weight: float = 2.0

    def __post_init__(self) -> None:
        require_at_least(1, "semantic_map.network", self, "grids")
        require_at_least(0, "semantic_map.network", self, "plane_weight")


@dataclass(frozen=True)
class SemanticMapConfig:
    """All parameters of the semantic map.

    Attributes:
        voxel: edge length of a voxel, m; each voxel contains at most one point, whatever the number of frames.
        rules: parameters of the baseline.
        network: parameters of the network classifier.
    """

    voxel: float = 0.02
    rules: RuleConfig = RuleConfig()
    network: NetworkConfig = NetworkConfig()

    def __post_init__(self) -> None:
        require_positive("semantic_map", self, "voxel")
