"""The obstacle check: whether an obstacle that the map does not show stands in the robot's way.

A plan leads over ground that is free in the map, and the map is as old as the last keyframe. So the robot
checks the depth image while it drives.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.sensor import SensorModel
from pipeline.traversability.traversability import Traversability

STRIDE = 0.4
"""m of straight driving between two checks."""
FAR = 2.0
"""m from the robot's middle; farther obstacles do not count yet."""
MARGIN = 0.1
"""m before the robot's front at the way point in which obstacles count."""
SIDE_MARGIN = 0.0215
"""m on each side of the footprint that must be free as well."""
LOW = 0.15
"""m above the ground in the map; obstacles have returns between this height and the robot's headroom."""
MIN_RETURNS = 50
"""Least number of returns in a cell with an obstacle; noise gives none, the thickest dust at most 17, measured."""


class ObstacleCheck:
    """Watches the way of one drive.

    Attributes:
        obstacles: (N, 3) returns of obstacles in the way that the map does not show, m in ``map``.
    """

    def __init__(
        self, returns: Callable[[], NDArray[np.float32]], traversability: Traversability, sensor: SensorModel
    ):
        """``returns``: gives (N, 3) the present returns of a camera, m in ``map``."""
        self.obstacles = np.zeros((0, 3), np.float32)
        self._returns, self._traversability, self._sensor = returns, traversability, sensor
        self._target: NDArray[np.float64] | None = None
        self._last = np.zeros(2)

    def is_clear(self, position: NDArray[np.float64], target: NDArray[np.float64]) -> bool:
        """Whether no obstacle stands between the robot and a way point (2,), m, that it drives straight to.

        It takes an image when the way point is new, and every ``STRIDE``, unless the way point is nearer than the
        camera sees.
        """
        is_new, model = target is not self._target, self._traversability.robot
        if np.linalg.norm(target - position) + model.half_length < self._sensor.nearest:
            return True
        if is_new or np.linalg.norm(position - self._last) >= STRIDE:
            self._target, self._last = target, position
            self.obstacles = self._obstacles(position, target)
        return not len(self.obstacles)

    def _obstacles(self, start: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float32]:
        """(M, 3) m, the returns of obstacles between two places (2,) on traversable ground."""
        ground, points = self._traversability, self._returns()
        length = max(float(np.linalg.norm(target - start)), 1e-6)
        ahead = (target - start) / length
        along = (points[:, :2] - start) @ ahead
        across = (points[:, :2] - start) @ np.array([-ahead[1], ahead[0]])
        on_way = (along > 0) & (along < min(length + ground.robot.half_length + MARGIN, FAR))
        near = points[on_way & (abs(across) < ground.robot.half_width + SIDE_MARGIN)]
        height = near[:, 2] - ground.grid.at(ground.elevation, near, outside=np.nan)
        near = near[ground.grid.at(ground.traversable, near) & (height > LOW) & (height < ground.robot.headroom)]
        _, cell, count = np.unique(ground.grid.cell_of(near), axis=0, return_inverse=True, return_counts=True)
        return near[count[cell.ravel()] >= MIN_RETURNS]
