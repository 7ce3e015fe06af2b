"""Parameters of the topological map."""

from dataclasses import dataclass

from pipeline.errors import require_at_least, require_positive


@dataclass(frozen=True)
class TopologicalMapConfig:
    """Where nodes lie, and which drives join them.

    Attributes:
        sight: maximum distance at which a node sees ground, m.
        block: side of a block that contributes one candidate for a node, cells.
        spare: maximum number of cells that are not worth a node; 4 cells of 5 cm are 1 dm².
        linked: share of the greatest gain above which a position is preferred if a straight drive joins it to a node.
        snap: maximum distance by which a node is moved to where the robot can stand and turn, m.
        joint: distance from a path between groups of nodes within which a single position to join both is sought, m.
        place_gain: area of ground that a position of the thesis's rules must add to become a node, m².
        same_level: maximum difference in height between a segment and ground that belongs to it, m.
        large_ramp: length above which a straight ramp has a node in each half, m.
        before_ramp: distance of the robot from the bottom edge of an inclined ramp, m, so that it does not slide.
        wall_gap: distance within which a line meets a wall of the semantic map, m. The traversability already keeps
            the whole footprint away from hazards.
        max_detour: maximum ratio of the shortest path in the roadmap to that over all possible drives.
    """

    sight: float = 2.0
    block: int = 4
    spare: int = 4
    linked: float = 0.7
    snap: float = 0.3
    joint: float = 0.6
    place_gain: float = 1.0
    same_level: float = 0.12
    large_ramp: float = 1.8
    before_ramp: float = 0.2
    wall_gap: float = 0.15
    max_detour: float = 1.1

    def __post_init__(self) -> None:
        require_positive("topological_map", self, "sight")
        require_at_least(1, "topological_map", self, "block", "max_detour")
