"""Which nodes straight drives join, and how long these take (thesis 3.3, figures 8 to 10)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.segments.crossings import crossings
from pipeline.segments.segments import Segment
from pipeline.traversability.shortest_paths_kernels import ACROSS
from pipeline.traversability.traversability import Traversability


@dataclass(frozen=True)
class LinkConfig:
    """Which straight drives are edges, and what they cost.

    Attributes:
        body_low, body_high: m above the ground between which walls meet the robot's body.
        body_margin: a line that comes so near to a wall meets it, m. The surface keeps the whole footprint off
            hazards; this asks the walls of the semantic map as well.
        max_length: of an edge, m.
        speed: expected on level ground, m/s.
        ramp_speed: expected on ramps and just before them, m/s; the robot slows down, aligns itself and slips.
        stop_time: that a node costs on the way, s: slow down, turn, set off.
    """

    body_low: float = 0.2
    body_high: float = 0.5
    body_margin: float = 0.15
    max_length: float = 15.0
    speed: float = 0.2
    ramp_speed: float = 0.1
    stop_time: float = 2.0


class Links:
    """Answers for one look which straight lines the robot can drive."""

    def __init__(self, traversability: Traversability, walls: Sequence[Segment], config: LinkConfig):
        self._surface, self._walls, self._config = traversability, walls, config

    def are_free(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether the footprint, swept along the lines between points (N, 3) on the ground, meets nothing.

        The surface tells of drops, steps, ramps' sides, tilt, low ceilings and unknown ground, and the segments of
        walls.
        """
        config = self._config
        free = np.linalg.norm(ends - starts, axis=1) <= config.max_length
        free[free] = self._surface.lines_are_traversable(starts[free], ends[free])
        lift = np.array([0, 0, config.body_low])
        a, b = starts[free] + lift, ends[free] + lift
        height = config.body_high - config.body_low
        free[free] = ~crossings(a, b, self._walls, config.body_margin, height)
        return free

    def seconds(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) expected time to drive the lines between points (N, 2 or 3)."""
        return drive_seconds(self._surface, starts, ends, self._config)


def drive_seconds(
    traversability: Traversability, starts: NDArray[np.float64], ends: NDArray[np.float64], config: LinkConfig
) -> NDArray[np.float64]:
    """(N,) expected time in s to drive the lines between points (N, 2 or 3), and to stop once.

    Metres across the slope of a ramp take as many times as long as on the grid.
    """
    a, b = starts[:, :2], ends[:, :2]
    on_ramp = traversability.metres_on(a, b, traversability.ramp)
    level = np.linalg.norm(b - a, axis=1) - on_ramp
    slow = on_ramp + (ACROSS - 1) * traversability.metres_across(a, b)
    return level / config.speed + slow / config.ramp_speed + config.stop_time
