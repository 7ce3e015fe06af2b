"""The speed limit along a stretch, which depends on the mapped ground and on mapped people."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from pipeline.arrays import Places, Values
from pipeline.elevation_map.pose_kernels import level_speed
from pipeline.elevation_map.traversability import Traversability
from pipeline.navigation.config import NavigationConfig
from pipeline.planning.stretches import Stretch


class SpeedLimit:
    """Computes the maximum speeds along a stretch over mapped ground."""

    def __init__(
        self,
        traversability: Traversability,
        ramps: Sequence[NDArray[np.floating]] = (),
        people: Sequence[NDArray[np.floating]] = (),
        config: NavigationConfig = NavigationConfig(),
    ):
        """``ramps``, ``people``: (N, 3) points of each inclined ramp and of each person in ``map``, m."""
        self._traversability, self._config = traversability, config.speed_limit
        self._deceleration = config.follower.braking * traversability.robot.acceleration
        slow = (
            (ramps, self._config.beside_ramps, traversability.robot.ramp_speed),
            (people, self._config.beside_people, self._config.speed_near_people),
        )
        self._slow = [(KDTree(np.vstack(these)[:, :2]), near, most) for these, near, most in slow if len(these)]

    def __call__(self, stretch: Stretch) -> Values:
        """(N,) m/s, maximum speeds at the poses of a stretch, from which the robot can brake for limits ahead."""
        robot, poses = self._traversability.robot, stretch.poses
        turn_rate = min(robot.turn_rate, self._config.arc_lag * robot.turn_acceleration)
        along, tiny = stretch.distances_along, np.finfo(np.float64).eps
        # The median leaves out single bends without an arc. In such a bend, the follower turns the robot while it
        # drives; until the robot has turned, it drives straight on and leaves its line.
        curvature = np.abs(stretch.curvature)
        in_arcs = ndimage.median_filter(curvature, 3, mode="mirror")
        bends = np.append(np.maximum(curvature - in_arcs, 0.0)[:-1] * np.diff(along), 0.0)
        turning = turn_rate / np.maximum(in_arcs, tiny)
        bending = self._config.max_bend_offset / np.maximum(self._config.arc_lag * bends, tiny)
        speeds = np.minimum(self._ground_limits(poses), np.minimum(turning, bending))
        return brakeable_speeds(speeds, along, self._deceleration)

    def _ground_limits(self, poses: Places) -> Values:
        """(N,) m/s, maximum speeds at poses (N, 3) that the ground and the people nearby allow."""
        t, robot = self._traversability, self._traversability.robot
        costs = t.costs()
        front = poses[:, :2] + robot.half_length * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        speeds = level_speed(t.pose_clearances(poses), robot.speed, costs.full_speed_clearance, costs.narrow_speed)
        on_ramp = t.grid.at(t.ramp, poses) | t.grid.at(t.ramp, front)
        speeds = np.where(on_ramp, np.minimum(robot.ramp_speed, speeds), speeds)
        for tree, near, most in self._slow:
            is_near = np.isfinite(
                np.minimum(*(tree.query(at[:, :2], distance_upper_bound=near)[0] for at in (poses, front)))
            )
            speeds = np.where(is_near, np.minimum(most, speeds), speeds)
        return speeds


def brakeable_speeds(speeds: Values, along: Values, deceleration: float) -> Values:
    """(N,) m/s, speeds reduced so that the robot can brake for lower speeds ahead.

    ``along``: (N,) distances from the start, m.
    """
    squares = speeds**2 + 2 * deceleration * along
    return np.sqrt(np.minimum.accumulate(squares[::-1])[::-1] - 2 * deceleration * along)
