"""Which nodes straight drives join, and how long these take (thesis 3.3, figures 8 to 10)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability
from pipeline.segments.crossings import crossings
from pipeline.segments.segment import Segment

BODY_MARGIN = 0.15
"""m; a line this close to a wall of the semantic map meets it. The traversability keeps the whole footprint off
hazards already."""


class StraightDrives:
    """Tests which straight lines the robot can drive, by the maps of one step.

    Attributes:
        traversability: of the ground.
        walls: of the semantic map.
    """

    def __init__(self, traversability: Traversability, walls: Sequence[Segment]):
        self.traversability, self.walls = traversability, walls

    def are_free(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether the footprint, swept along lines between points (N, 3) of the ground, m, meets no obstacle.

        The traversability contains drops, steps, ramps' sides, tilt, low ceilings and unknown ground, and the
        segments contain walls, which stand in the way between half of the body's height and the headroom.
        """
        free = np.isfinite(self.traversability.line_seconds(starts, ends))
        robot = self.traversability.robot
        lift = np.array([0, 0, robot.body_height / 2])
        a, b = starts[free] + lift, ends[free] + lift
        free[free] = ~crossings(a, b, self.walls, BODY_MARGIN, robot.headroom - robot.body_height / 2)
        return free


def drive_seconds(
    traversability: Traversability, starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) expected time in s to drive the lines between points (N or 1, 2 or 3), and to stop once."""
    return traversability.line_seconds(starts, ends) + traversability.config.costs.stop
