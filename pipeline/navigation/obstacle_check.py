"""The obstacle check, which finds obstacles on the robot's path that the map does not show.

A plan leads over ground that is free in the map, but the map is only as recent as the last keyframe. Therefore, the
robot also checks depth images while it drives.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from pipeline.arrays import Mask, Places, Points
from pipeline.elevation_map.traversability import Traversability
from pipeline.navigation.commands import Approach
from pipeline.navigation.config import ObstacleCheckConfig
from pipeline.planning.stretches import Stretch
from pipeline.sensor import SensorModel
from pipeline.transforms import wrap_angle


class ObstacleCheck:
    """Watches the path of one drive for obstacles that the map does not show.

    Attributes:
        obstacles: (N, 3) m, the camera's returns in ``map`` from unmapped obstacles on the path.
    """

    def __init__(
        self,
        traversability: Traversability,
        sensor: SensorModel,
        config: ObstacleCheckConfig,
        people: Sequence[Points] = (),
        beside_people: float = 0.0,
    ):
        """Watch a drive over mapped ground.

        Args:
            traversability: the ground over which the drive was planned.
            sensor: model of the camera.
            config: how often and how far ahead to look.
            people: the points of each person from whom the plan keeps off, m.
            beside_people: distance from people within which the robot drives slowly, m.
        """
        self.obstacles: Points = np.zeros((0, 3), np.float32)
        self._beside_people = beside_people
        self._people = KDTree(np.concatenate(people)[:, :2]) if people else None
        self._traversability, self._sensor, self._config = traversability, sensor, config
        self._stretch: Stretch | None = None
        # At the last check: remaining length of the stretch, m, and direction of travel, rad
        self._remaining_length, self._direction = np.inf, 0.0

    def is_due(self, command: Approach) -> bool:
        """Whether a check is due: on a new stretch, after some distance, or after an arc has turned the camera.

        No check is due if the rest of the path is too near for the camera.
        """
        is_far = self._remaining_length - command.remaining_length >= self._config.distance_between_checks
        has_turned = abs(wrap_angle(command.direction - self._direction)) >= self._config.angle_between_checks
        is_new = command.stretch is not self._stretch
        return (is_new or is_far or has_turned) and not self._is_too_near(command)

    def is_clear(self, command: Approach) -> bool:
        """Whether no obstacle was seen on the path, or the rest of the path is too near for the camera."""
        return self._is_too_near(command) or not len(self.obstacles)

    def look(self, command: Approach, points: Points) -> None:
        """Find obstacles on the path among the camera's returns ``points`` (N, 3) in ``map``, m.

        An obstacle is a cell of known ground with enough returns at heights between half the body's height and the
        headroom. Cells next to a mapped hazard do not count, because the returns may come from this hazard.
        """
        self._stretch, self._direction = command.stretch, command.direction
        self._remaining_length = command.remaining_length
        ground = self._traversability
        robot = ground.robot
        path = self._path_ahead(command.path)
        reach = robot.half_width + ground.grid.cell
        is_beside = ((points[:, :2] >= path.min(axis=0) - reach) & (points[:, :2] <= path.max(axis=0) + reach)).all(
            axis=1
        )
        points = points[is_beside]
        height = points[:, 2] - ground.grid.at(ground.elevation, points, outside=np.nan)
        is_high = (height > robot.body_height / 2) & (height < robot.headroom)
        is_news = ground.grid.at(ground.to_hazard, points, outside=0.0) > 1.5 * ground.grid.cell
        near = points[is_high & is_news]
        near = near[self._on_path(near, path, robot.half_width)]
        _, number, count = np.unique(ground.grid.cell_of(near), axis=0, return_inverse=True, return_counts=True)
        self.obstacles = near[count[number.ravel()] >= self._config.min_returns]

    def forget(self) -> None:
        """Forget the obstacles, because the pose from which the robot saw them is in doubt."""
        self.obstacles = np.zeros((0, 3), np.float32)

    def meets_person(self, people: Sequence[Points], command: Approach) -> bool:
        """Whether the path leads too near to a part of a person of which the plan did not know.

        Parts nearer than ``keep_off`` to the footprint are too near, because a hand on the floor is too low to be an
        obstacle. If the plan did not know of the person at all, all parts within ``beside_people`` of the path are
        too near.

        Args:
            people: the points of each person seen so far, m.
            command: the command to drive along the path.
        """
        path = self._path_ahead(command.path)
        keep_off = self._traversability.config.keep_off
        beside = self._traversability.robot.half_width + keep_off
        for points in people:
            is_new = np.ones(len(points), np.bool_)
            if self._people is not None:
                is_new = self._people.query(points[:, :2])[0] > keep_off
            reach = max(beside, self._beside_people) if is_new.all() else beside
            if self._on_path(points[is_new], path, reach).any():
                return True
        return False

    def _is_too_near(self, command: Approach) -> bool:
        """Whether an obstacle anywhere up to the end of the stretch would be too near for the camera."""
        return command.remaining_length + self._traversability.robot.half_length < self._sensor.nearest

    def _path_ahead(self, path: Places) -> Places:
        """(N, 2) m, the path extended by half the footprint's length and a margin, but at most ``ahead`` m long.

        It has at least two positions, and thus a direction, however small ``ahead`` is.
        """
        robot, cell = self._traversability.robot, self._traversability.grid.cell
        path = _extended(path, robot.half_length + 2 * cell)
        far = np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum() < self._config.ahead
        return path[np.append([True, True], far[1:])]

    def _on_path(self, points: Points, path: Places, reach: float) -> Mask:
        """(N,) whether points (N, 3) lie within ``reach`` m of an extended path, up to its ends."""
        half_cell = self._traversability.grid.cell / 2
        distance, number = KDTree(path).query(points[:, :2], distance_upper_bound=reach + half_cell)
        is_behind = (points[:, :2] - path[0]) @ (path[1] - path[0]) <= 0
        beyond = (points[:, :2] - path[-1]) @ (path[-1] - path[-2]) >= 0
        return np.isfinite(distance) & ~(is_behind & (number == 0)) & ~(beyond & (number == len(path) - 1))


def _extended(path: Places, by: float) -> Places:
    """A path (N, 2), m, extended straight ahead by ``by`` m."""
    ahead = (path[-1] - path[-2]) / np.linalg.norm(path[-1] - path[-2])
    steps = np.arange(0.0, by, np.linalg.norm(path[-1] - path[-2]))[1:, None]
    return np.vstack([path, path[-1] + steps * ahead])
