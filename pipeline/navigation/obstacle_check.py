"""The obstacle check: whether an obstacle that the map does not show stands in the robot's way.

A plan leads over ground that is free in the map, and the map is as old as the last keyframe. So the robot
checks the depth image while it drives.
"""

import numpy as np

from pipeline.arrays import Place, Points
from pipeline.elevation_map.traversability import Traversability
from pipeline.navigation.config import ObstacleCheckConfig
from pipeline.sensor import SensorModel


class ObstacleCheck:
    """Watches the way of one drive.

    Attributes:
        obstacles: returns of obstacles in the way that the map does not show.
    """

    def __init__(self, traversability: Traversability, sensor: SensorModel, config: ObstacleCheckConfig):
        """Watch a drive over ground that is known so well, with a camera."""
        self.obstacles: Points = np.zeros((0, 3), np.float32)
        self._traversability, self._sensor, self._config = traversability, sensor, config
        self._target: Place | None = None
        self._last = np.zeros(2)

    def is_due(self, position: Place, target: Place) -> bool:
        """Whether to look again from a position on a straight way to a way point (2,): a new one, or some way on."""
        is_new = target is not self._target
        is_far = is_new or bool(np.linalg.norm(position - self._last) >= self._config.every)
        return is_far and not self._is_too_near(position, target)

    def is_clear(self, position: Place, target: Place) -> bool:
        """Whether no obstacle was seen between a position and a way point."""
        return self._is_too_near(position, target) or not len(self.obstacles)

    def look(self, position: Place, target: Place, points: Points) -> None:
        """Find the obstacles among the camera's returns between a position and a way point, on traversable ground.

        They are between half of the body's height and the headroom above the ground in the map.
        """
        self._target, self._last = target, position
        self.obstacles = self._obstacles(position, target, points)

    def _is_too_near(self, position: Place, target: Place) -> bool:
        """Whether the camera does not see what stands before the way point."""
        reach = np.linalg.norm(target - position) + self._traversability.robot.half_length
        return bool(reach < self._sensor.nearest)

    def _obstacles(self, start: Place, target: Place, points: Points) -> Points:
        ground = self._traversability
        robot, cell = ground.robot, ground.grid.cell
        length = max(float(np.linalg.norm(target - start)), np.finfo(np.float64).eps)
        ahead = (target - start) / length
        along = (points[:, :2] - start) @ ahead
        across = (points[:, :2] - start) @ np.array([-ahead[1], ahead[0]])
        on_way = (along > 0) & (along < min(length + robot.half_length + 2 * cell, self._config.ahead))
        near = points[on_way & (abs(across) < robot.half_width + cell / 2)]
        height = near[:, 2] - ground.grid.at(ground.elevation, near, outside=np.nan)
        near = near[
            ground.grid.at(ground.traversable, near) & (height > robot.body_height / 2) & (height < robot.headroom)
        ]
        _, number, count = np.unique(ground.grid.cell_of(near), axis=0, return_inverse=True, return_counts=True)
        return near[count[number.ravel()] >= self._config.least_returns]
