"""Which nodes straight drives join, and how long these take (thesis 3.3, figures 8 to 10)."""

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Mask, Places, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.segments.crossings import crossings
from pipeline.segments.segment import Segment


class StraightDrives:
    """Tests which straight lines the robot can drive, by the maps of one step.

    Attributes:
        traversability: of the ground.
        walls: of the semantic map.
        wall_gap: m; a line this close to a wall meets it.
    """

    def __init__(self, traversability: Traversability, walls: Sequence[Segment], wall_gap: float):
        self.traversability, self.walls, self.wall_gap = traversability, walls, wall_gap

    def are_free(self, starts: Places, ends: Places) -> Mask:
        """Whether the footprint, swept along lines between points (N, 3) of the ground, meets no obstacle.

        The traversability contains drops, steps, ramps' sides, tilt, low ceilings and unknown ground, and the
        segments contain walls, which stand in the way between half of the body's height and the headroom.
        """
        free = np.isfinite(self.traversability.line_seconds(starts, ends))
        robot = self.traversability.robot
        lift = np.array([0, 0, robot.body_height / 2])
        a, b = starts[free] + lift, ends[free] + lift
        free[free] = ~crossings(a, b, self.walls, self.wall_gap, robot.headroom - robot.body_height / 2)
        return free


def drive_seconds(traversability: Traversability, starts: Places, ends: Places) -> Values:
    """Expected time, s, to drive the lines between points, one or N on each side, and to stop once."""
    return traversability.line_seconds(starts, ends) + traversability.config.costs.stop
