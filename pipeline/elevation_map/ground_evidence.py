"""Evidence about the ground, relative to the robot's pose at the time, so that it moves if the pose is corrected."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Box, Indices, Points, Pose
from pipeline.elevation_map.config import ElevationConfig
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame
from pipeline.geometry.moving_kernels import moved
from pipeline.robot import RobotModel
from pipeline.transforms import yaw_of


def box_of(*clouds: NDArray[np.floating]) -> Box:
    """The bounding box of clouds (N, 3), m in ``base_link``, and the robot's centre."""
    points = np.concatenate([np.zeros((1, 3)), *clouds])
    return np.array([points.min(axis=0), points.max(axis=0)], np.float64)


class GroundEvidence(Protocol):
    """Evidence about the ground near a keyframe."""

    @property
    def box(self) -> Box:
        """The bounding box of everything that it changes, in ``base_link``."""
        ...

    def put(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Add it to a map for a given pose of the keyframe."""
        ...


@dataclass(frozen=True, eq=False)
class Assumed:
    """Ground assumed to be level around the start, because the camera sees none within 1 m.

    Attributes:
        points: points in ``base_link``, at least one in each cell.
    """

    points: Points

    @classmethod
    def under(cls, T_base_start: Pose, robot: RobotModel, config: ElevationConfig) -> "Assumed":
        """The ground around the pose where the robot was set down, as far as clearances matter to it."""
        radius = robot.corner_radius + config.traversability.costs.comfort
        points = _lattice(-radius, radius, radius, config.cell)
        return cls(moved(T_base_start, points[np.hypot(*points.T[:2]) <= radius]))

    @classmethod
    def before(cls, frame: Frame, points: Points, robot: RobotModel, config: ElevationConfig) -> "Assumed":
        """The ground ahead of a robot, in the directions in which the camera's nearest return is level ground.

        Towards the edge of a deck or a wall, the camera has no such return within ``start_ahead``. Directions outside
        its view are treated like the edge of the view. ``points``: its returns in ``base_link``.
        """
        widest = np.arctan(frame.intrinsics.cx / frame.intrinsics.fx)
        ahead, step = config.start_ahead, config.cell / config.start_ahead  # step, rad: a cell at the strip's end

        def bin_of(places: Points) -> Indices:
            x, y = (places[:, :2] - frame.T_base_camera[:2, 3]).T
            return ((np.clip(np.arctan2(y, x), -widest, widest) + widest) / step).astype(np.int64)

        near = points[(points[:, 0] > 0) & (points[:, 0] < ahead)]
        near = near[np.argsort(-near[:, 0])]
        height = np.full(int(2 * widest / step) + 1, np.inf)
        height[bin_of(near)] = near[:, 2]
        strip = _lattice(0.0, ahead, robot.half_width + config.cell, config.cell)
        return cls(strip[np.abs(height[bin_of(strip)]) <= config.bin])

    @property
    def box(self) -> Box:
        """The bounding box of its points, in ``base_link``."""
        return box_of(self.points)

    def put(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Assume the ground for a given pose of the keyframe."""
        elevation_map.assume_ground(moved(T_map_base, self.points))


def _lattice(x0: float, x1: float, y: float, cell: float) -> Points:
    """Points of the level rectangle from x0 to x1 and from -y to y, m, at least one in each cell."""
    step = cell / np.sqrt(2)
    xy = np.mgrid[x0 : x1 + step : step, -y : y + step : step].reshape(2, -1)
    return np.pad(xy, ((0, 1), (0, 0))).T.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Driven:
    """What a drive has shown near a keyframe, in its ``base_link``.

    Attributes:
        track: successive positions of the robot's centre.
        yaws: (N,) float32 headings of the robot there, rad.
        obstacles: points on obstacles in its path.
        touched: points that the robot touched.
    """

    track: Points
    yaws: NDArray[np.float32]
    obstacles: Points
    touched: Points

    @property
    def box(self) -> Box:
        """The bounding box of its points, in ``base_link``."""
        return box_of(self.track, self.obstacles, self.touched)

    def put(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Add track, obstacles and contacts for a given pose of the keyframe.

        The robot can stand where it has been, until an obstacle is found there.
        """
        track, obstacles, touched = (moved(T_map_base, p) for p in (self.track, self.obstacles, self.touched))
        elevation_map.update(obstacles, height=float(T_map_base[2, 3]))
        elevation_map.forget_track(np.concatenate([obstacles, touched]))
        elevation_map.add_track(np.column_stack([track[:, :2], self.yaws + yaw_of(T_map_base)]))
        if len(touched):
            elevation_map.add_obstacle(touched)
