"""How fast the ground before the wheels may be driven on."""

import numpy as np
from numpy.typing import NDArray

from pipeline.traversability.traversability import NARROW_SPEED, Traversability

AHEAD = np.arange(0.0, 0.75, 0.05)
"""m from the robot's middle, on its way, that are looked at: to where its wheels are when it has slowed down."""
NARROW = 0.45
"""m from the robot's middle to an obstacle; nearer ones slow it down."""


class Pace:
    """Tells the greatest speed by what the map shows under and before the wheels."""

    def __init__(self, traversability: Traversability):
        self._traversability = traversability

    def __call__(self, here: NDArray[np.float64], along: NDArray[np.float64]) -> float:
        """m/s for a robot at (2,) m that drives along a unit vector (2,)."""
        t, robot = self._traversability, self._traversability.robot
        places = here + AHEAD[:, None] * along
        if t.grid.at(t.ramp, places).any():
            return robot.ramp_speed
        is_narrow = (t.grid.at(t.to_obstacle, places) < NARROW).any()
        return min(robot.speed, NARROW_SPEED) if is_narrow else robot.speed
