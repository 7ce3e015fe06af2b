"""The numbers of the topological map."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TopologicalMapConfig:
    """Where nodes lie, and which drives join them.

    Attributes:
        sight: m, greatest distance at which a node sees ground.
        block: cells along each side of a block that has one candidate for a node.
        spare: greatest number of cells that are not worth a node; 4 of 5 cm are 1 dm².
        linked: share of the greatest gain from which a place is preferred if a straight drive joins it to a node.
        snap: m, greatest distance by which a node is moved to where the robot can stand and turn.
        joint: m around a way between groups of nodes within which one place that joins both is looked for.
        place_gain: m² of ground that a place of the thesis's rules must add to become a node.
        same_level: m; ground that differs more in height from a segment does not belong to it.
        large_ramp: m; a longer straight ramp has a node in each half.
        before_ramp: m that the robot keeps from the bottom edge of an inclined ramp, so that it does not slide.
        wall_gap: m; a line this close to a wall of the semantic map meets it. The traversability keeps the whole
            footprint off hazards already.
        max_detour: greatest ratio of the shortest way over the roadmap to that over all possible drives.
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
