"""Which nodes can be joined by straight drives, and how long these take (thesis 3.3, figures 8 to 10)."""

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Mask, Places, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.segments.crossings import crossings
from pipeline.segments.segment import Segment


class StraightDrives:
    """Tests which straight lines the robot can drive, according to the maps of one step.

    Attributes:
        traversability: where the robot may drive.
        walls: the walls of the semantic map.
        wall_gap: distance within which a line meets a wall, m.
    """

    def __init__(self, traversability: Traversability, walls: Sequence[Segment], wall_gap: float):
        self.traversability, self.walls, self.wall_gap = traversability, walls, wall_gap

    def are_free(self, starts: Places, ends: Places) -> Mask:
        """(N,) whether the footprint, swept along lines between points (N, 3) on the ground, meets no obstacle.

        The traversability covers drops, steps, the sides of ramps, tilt, low ceilings and unknown ground. The
        segments cover walls, which block a line between half the body's height and the headroom.
        """
        free = np.isfinite(self.traversability.line_seconds(starts, ends))
        robot = self.traversability.robot
        lift = np.array([0, 0, robot.body_height / 2])
        a, b = starts[free] + lift, ends[free] + lift
        free[free] = ~crossings(a, b, self.walls, self.wall_gap, robot.headroom - robot.body_height / 2)
        return free


def drive_seconds(traversability: Traversability, starts: Places, ends: Places) -> Values:
    """(N,) costs of driving the lines between points, one or N on each side, and of stopping once, s."""
    return traversability.line_seconds(starts, ends) + traversability.config.costs.stop
