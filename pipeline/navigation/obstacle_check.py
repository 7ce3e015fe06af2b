"""The obstacle check: whether an obstacle that the map does not show stands in the robot's way.

A plan leads over ground that is free in the map, and the map is as old as the last keyframe. So the robot
checks the depth image while it drives.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability
from pipeline.sensor import SensorModel

CHECK_WAY = 0.4
"""m of straight driving between two checks."""
CHECKED_AHEAD = 2.0
"""m from the robot's middle; farther obstacles do not count yet."""
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

        It takes an image when the way point is new, and every ``CHECK_WAY``, unless the way point is nearer than the
        camera sees.
        """
        is_new, model = target is not self._target, self._traversability.robot
        if np.linalg.norm(target - position) + model.half_length < self._sensor.nearest:
            return True
        if is_new or np.linalg.norm(position - self._last) >= CHECK_WAY:
            self._target, self._last = target, position
            self.obstacles = self._obstacles(position, target)
        return not len(self.obstacles)

    def _obstacles(self, start: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float32]:
        """(M, 3) m, the returns of obstacles between two places (2,) on traversable ground.

        They are between half of the body's height and the headroom above the ground in the map.
        """
        ground, points = self._traversability, self._returns()
        robot, cell = ground.robot, ground.grid.cell
        length = max(float(np.linalg.norm(target - start)), np.finfo(np.float64).eps)
        ahead = (target - start) / length
        along = (points[:, :2] - start) @ ahead
        across = (points[:, :2] - start) @ np.array([-ahead[1], ahead[0]])
        on_way = (along > 0) & (along < min(length + robot.half_length + 2 * cell, CHECKED_AHEAD))
        near = points[on_way & (abs(across) < robot.half_width + cell / 2)]
        height = near[:, 2] - ground.grid.at(ground.elevation, near, outside=np.nan)
        near = near[
            ground.grid.at(ground.traversable, near) & (height > robot.body_height / 2) & (height < robot.headroom)
        ]
        _, number, count = np.unique(ground.grid.cell_of(near), axis=0, return_inverse=True, return_counts=True)
        return near[count[number.ravel()] >= MIN_RETURNS]
