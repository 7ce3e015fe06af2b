"""The greatest speed on the ground before the wheels."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from pipeline.elevation_map.pose_kernels import STANDING, level_speed
from pipeline.elevation_map.traversability import Traversability
from pipeline.navigation.config import SpeedLimitConfig
from pipeline.planning.pose_paths import nearest_heading


class SpeedLimit:
    """Computes the greatest speed from what the maps show under and before the wheels."""

    def __init__(
        self,
        traversability: Traversability,
        ramps: Sequence[NDArray[np.floating]] = (),
        people: Sequence[NDArray[np.floating]] = (),
        config: SpeedLimitConfig = SpeedLimitConfig(),
    ):
        """``ramps``, ``people``: (N, 3) points of each inclined ramp and person of the semantic map, m."""
        self._traversability, robot, cell = traversability, traversability.robot, traversability.grid.cell
        # Far enough to brake from full speed half as fast as it could, so that wheels do not skid.
        self._ahead = np.arange(0.0, robot.half_length + robot.speed**2 / robot.acceleration + cell, cell)
        slow = ((ramps, config.beside_ramps, robot.ramp_speed), (people, config.beside_people, config.people_speed))
        self._slow = [(KDTree(np.vstack(these)[:, :2]), near, most) for these, near, most in slow if len(these)]

    def __call__(self, here: NDArray[np.float64], along: NDArray[np.float64]) -> float:
        """m/s for a robot at (2,) m that drives along a unit vector (2,): it can brake in time for slower ground."""
        t, robot = self._traversability, self._traversability.robot
        places = here + self._ahead[:, None] * along
        clearance = t.clearance[..., nearest_heading(float(np.arctan2(along[1], along[0]))) % STANDING]
        costs = t.config.costs
        speeds = level_speed(0.01 * t.grid.at(clearance, places), robot.speed, costs.comfort, costs.narrow_speed)
        speeds = np.where(t.grid.at(t.ramp, places), np.minimum(robot.ramp_speed, speeds), speeds)
        for tree, near, most in self._slow:
            is_near = np.isfinite(tree.query(places, distance_upper_bound=near)[0])
            speeds = np.where(is_near, np.minimum(most, speeds), speeds)
        left = np.maximum(self._ahead - robot.half_length, 0.0)
        return float(np.sqrt(speeds**2 + robot.acceleration * left).min())
