"""Parameters of the topological map."""

from dataclasses import dataclass

from pipeline.errors import require_at_least, require_positive

MAX_SIGHT_CELLS = 250
"""Maximum of ``sight``, cells; the memory, and the time to prepare the rays, grow with the square of ``sight``."""


@dataclass(frozen=True)
class TopologicalMapConfig:
    """Limits for the positions of nodes and for the drives between nodes.

    Attributes:
        sight: maximum distance at which a node sees ground, m.
        max_uncovered_cells: maximum number of unseen cells that are not worth a node; 4 cells of 5 cm are 1 dm².
        max_snap_distance: maximum distance by which a node is moved to a position where the robot can stand and turn,
            m.
        min_place_gain: minimum area of ground that a position by the thesis's rules must add to become a node, m².
        before_ramp: distance, m, between the bottom edge of an inclined ramp and the footprint of a robot at the node
            in front of the ramp, so that the robot does not slide.
        max_detour: maximum ratio between the cost of the cheapest path in the roadmap and the cost of the cheapest
            path over all possible drives.
    """

    sight: float = 2.0
    max_uncovered_cells: int = 4
    max_snap_distance: float = 0.3
    min_place_gain: float = 1.0
    before_ramp: float = 0.2
    max_detour: float = 1.1

    def __post_init__(self) -> None:
        require_positive("topological_map", self, "sight")
        require_at_least(
            0, "topological_map", self, "max_uncovered_cells", "max_snap_distance", "min_place_gain", "before_ramp"
        )
        require_at_least(1, "topological_map", self, "max_detour")
