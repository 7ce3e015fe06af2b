"""Evidence of the ground, relative to the robot's pose at that moment, so that it follows corrections of the pose."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.elevation_kernels import Z_BIN
from pipeline.elevation_map.elevation_map import CELL, ElevationMap
from pipeline.elevation_map.pose_kernels import MOST_ROOM
from pipeline.frame import Frame
from pipeline.geometry.moving_kernels import moved
from pipeline.robot import RobotModel
from pipeline.transforms import yaw_of

AHEAD = 1.4
"""m, length of the strip before the robot, in which ground may be taken for level where it was set down."""
BIN = CELL / AHEAD
"""rad; directions in which the strip is level or not: a cell at its end."""


def box_of(*clouds: NDArray[np.floating]) -> NDArray[np.float64]:
    """(2, 3) lowest and highest corner, m in ``base_link``, around clouds (N, 3) and the robot's middle."""
    points = np.concatenate([np.zeros((1, 3)), *clouds])
    return np.array([points.min(axis=0), points.max(axis=0)], np.float64)


class GroundEvidence(Protocol):
    """Something that tells of the ground near a keyframe."""

    @property
    def box(self) -> NDArray[np.float64]:
        """(2, 3) lowest and highest corner, m in ``base_link``, around all that it changes."""
        ...

    def put(self, elevation_map: ElevationMap, T_map_base: NDArray[np.float64]) -> None:
        """Add it to a map, at the keyframe's 4×4 pose."""
        ...


@dataclass(frozen=True, eq=False)
class Assumed:
    """Ground that is taken for level near where the robot was set down, for the camera sees none within 1 m.

    Attributes:
        points: (N, 3) float32 in ``base_link``, m, one in each cell at least.
    """

    points: NDArray[np.float32]

    @classmethod
    def under(cls, T_base_start: NDArray[np.float64], robot: RobotModel) -> "Assumed":
        """The ground around the 4×4 pose where the robot was set down, as far as room makes a difference to it."""
        radius = robot.corner_radius + MOST_ROOM
        points = _lattice(-radius, radius, radius)
        return cls(moved(T_base_start, points[np.hypot(*points.T[:2]) <= radius]))

    @classmethod
    def before(cls, frame: Frame, points: NDArray[np.float32], robot: RobotModel) -> "Assumed":
        """The ground before a robot, in the directions in which level ground is the nearest that its camera shows.

        Behind the edge of a deck, or before a wall, no level ground is among the returns so near that it could go on
        to there. Outside the camera's view it is as at its edge. ``points``: (N, 3) returns, m in ``base_link``.
        """
        widest = np.arctan(frame.intrinsics.cx / frame.intrinsics.fx)

        def bin_of(places: NDArray[np.float32]) -> NDArray[np.int64]:
            x, y = (places[:, :2] - frame.T_base_camera[:2, 3]).T
            return ((np.clip(np.arctan2(y, x), -widest, widest) + widest) / BIN).astype(np.int64)

        near = points[(points[:, 0] > 0) & (points[:, 0] < AHEAD)]
        near = near[np.argsort(-near[:, 0])]
        height = np.full(int(2 * widest / BIN) + 1, np.inf)
        height[bin_of(near)] = near[:, 2]
        strip = _lattice(0.0, AHEAD, robot.half_width + CELL)
        return cls(strip[np.abs(height[bin_of(strip)]) <= Z_BIN])

    @property
    def box(self) -> NDArray[np.float64]:
        """(2, 3) lowest and highest corner, m in ``base_link``, around its points."""
        return box_of(self.points)

    def put(self, elevation_map: ElevationMap, T_map_base: NDArray[np.float64]) -> None:
        """Assume the ground, relative to the 4×4 pose ``T_map_base``."""
        elevation_map.assume_ground(moved(T_map_base, self.points))


def _lattice(x0: float, x1: float, y: float) -> NDArray[np.float32]:
    """(N, 3) float32 points of the level rectangle from x0 to x1 and from -y to y, one in each cell at least."""
    step = CELL / np.sqrt(2)
    xy = np.mgrid[x0 : x1 + step : step, -y : y + step : step].reshape(2, -1)
    return np.pad(xy, ((0, 1), (0, 0))).T.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Driven:
    """What a drive has shown near a keyframe, m in its ``base_link``.

    Attributes:
        track: (N, 3) float32 successive positions of the robot's middle.
        yaws: (N,) float32 its headings there, rad.
        obstacles: (M, 3) float32 points of what stood in its way.
        touched: (K, 3) float32 points that the robot touched.
    """

    track: NDArray[np.float32]
    yaws: NDArray[np.float32]
    obstacles: NDArray[np.float32]
    touched: NDArray[np.float32]

    @property
    def box(self) -> NDArray[np.float64]:
        """(2, 3) lowest and highest corner, m in ``base_link``, around its points."""
        return box_of(self.track, self.obstacles, self.touched)

    def put(self, elevation_map: ElevationMap, T_map_base: NDArray[np.float64]) -> None:
        """Add track, obstacles and contacts, relative to the 4×4 pose ``T_map_base``.

        The robot can stand where it has been, until an obstacle is met there.
        """
        track, obstacles, touched = (moved(T_map_base, p) for p in (self.track, self.obstacles, self.touched))
        elevation_map.update(obstacles)
        elevation_map.forget_track(np.concatenate([obstacles, touched]))
        elevation_map.add_track(np.column_stack([track[:, :2], self.yaws + yaw_of(T_map_base)]))
        if len(touched):
            elevation_map.add_obstacle(touched)
