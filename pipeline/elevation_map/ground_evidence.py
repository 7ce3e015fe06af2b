"""Evidence about the ground, stored relative to a keyframe's pose, so that it moves when the pose is corrected."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Box, Depth, Indices, Points, Pose
from pipeline.elevation_map import overhangs_kernels
from pipeline.elevation_map.config import ElevationConfig
from pipeline.elevation_map.depth_dropouts_kernels import ROW_STEP, interpolate_dropouts
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame, Intrinsics
from pipeline.geometry.moving_kernels import moved
from pipeline.robot import RobotModel
from pipeline.sensor import SensorModel
from pipeline.transforms import inverse, transform_points, yaw_of

MIN_GAP_EXTENT = 3
"""Minimum extent of a gap in the depth image, in pixels along a row and in searched rows; smaller ones are noise."""
MAX_GAP_WIDTH = 60
"""Maximum width of a gap, pixels; in wider gaps, the ground stays unknown."""
MIN_DEPTH_DIFFERENCE = 0.05
"""Minimum difference in depth between a surface and the space that it hides, m, because the surface itself is in the
map."""
NOISE_SIGMAS = 3.0
"""Additional margin, in standard deviations of the sensor's noise."""
MAX_OVERHANG = 2.0
"""Maximum extent of an overhang behind its edge, m."""
MIN_PIXELS = 2
"""Minimum number of pixels, one above the other, that show an overhang; fewer are noise at an edge."""
TURNING_ROOM = 0.1
"""Free space assumed around the robot where it was set down, so that it can turn in place, m."""
MIN_SIDE_EXTENT = 0.05
"""Distance to both sides over which an overhang must continue, with ground below, m.

This condition rules out upright edges, which also hide the space behind them.
"""
FRACTION_STEP = 0.01
"""Spacing of points between the camera and the nearest ground that a panel hides, as a fraction of the distance
between them."""
MIN_SILL_HEIGHT = 0.08
"""Minimum height of the wall below a hole through which ground is seen, m; a lower one may be a slope in front of a
table."""


def turning_radius(robot: RobotModel) -> float:
    """Radius, m, around the robot's centre within which space is assumed to be free for a turn in place."""
    return robot.corner_radius + TURNING_ROOM


def box_of(*clouds: NDArray[np.floating]) -> Box:
    """The bounding box, m in ``base_link``, of clouds (N, 3), m, and the robot's centre."""
    points = np.concatenate([np.zeros((1, 3)), *clouds])
    return np.array([points.min(axis=0), points.max(axis=0)], np.float64)


class GroundEvidence(Protocol):
    """Evidence about the ground near a keyframe."""

    @property
    def box(self) -> Box:
        """The bounding box of everything that the evidence changes, m in ``base_link``."""
        ...

    def add_to_elevation_map(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Add the evidence to a map for a given pose of the keyframe."""
        ...


@dataclass(frozen=True, eq=False)
class AssumedGround:
    """Ground around the start that is assumed to be level, because the camera sees none within 1 m.

    Attributes:
        points: points on the ground in ``base_link``, at least one in each cell.
    """

    points: Points

    @classmethod
    def under(cls, T_base_start: Pose, robot: RobotModel, config: ElevationConfig) -> "AssumedGround":
        """The ground that the robot needs to turn in place where it was set down.

        The camera cannot see a wall that is nearer than the camera's minimum range, so no more ground than this is
        assumed.
        """
        radius = turning_radius(robot)
        points = _lattice(-radius, radius, radius, config.cell)
        return cls(moved(T_base_start, points[np.hypot(*points.T[:2]) <= radius]))

    @classmethod
    def before(cls, frame: Frame, points: Points, robot: RobotModel, config: ElevationConfig) -> "AssumedGround":
        """The ground ahead of a robot, in the directions in which the camera's nearest return is level ground.

        Towards a wall or the edge of a deck, the camera has no such return within ``start_ahead``. Directions outside
        the camera's view are treated like the edge of the view. ``points``: the camera's returns in ``base_link``.
        """
        widest = np.arctan(frame.intrinsics.cx / frame.intrinsics.fx)
        ahead = config.start_ahead
        step = config.cell / ahead  # rad: a cell at the strip's end

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
        """The bounding box of the points, m in ``base_link``."""
        return box_of(self.points)

    def add_to_elevation_map(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Assume the ground in a map for a given pose of the keyframe."""
        elevation_map.assume_ground(moved(T_map_base, self.points))


def _lattice(x0: float, x1: float, y: float, cell: float) -> Points:
    """Points of the level rectangle from x0 to x1 and from -y to y, m, at least one in each cell."""
    step = cell / np.sqrt(2)
    xy = np.mgrid[x0 : x1 + step : step, -y : y + step : step].reshape(2, -1)
    return np.pad(xy, ((0, 1), (0, 0))).T.astype(np.float32)


@dataclass(frozen=True, eq=False)
class DrivenTrack:
    """The evidence of a drive near a keyframe, in the keyframe's ``base_link``.

    Attributes:
        track: successive positions of the robot's centre.
        yaws: (N,) float32 headings of the robot there, rad.
        obstacles: points on obstacles in the robot's path.
        touched: points that the robot touched.
    """

    track: Points
    yaws: NDArray[np.float32]
    obstacles: Points
    touched: Points

    @property
    def box(self) -> Box:
        """The bounding box of the points, m in ``base_link``."""
        return box_of(self.track, self.obstacles, self.touched)

    def add_to_elevation_map(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Add the track, obstacles and contacts to a map for a given pose of the keyframe.

        The robot is assumed to be able to stand where it has been, until an obstacle is found there.
        """
        track, obstacles, touched = (moved(T_map_base, p) for p in (self.track, self.obstacles, self.touched))
        elevation_map.update(obstacles, height=float(T_map_base[2, 3]))
        elevation_map.forget_track(np.concatenate([obstacles, touched]))
        elevation_map.add_track(np.column_stack([track[:, :2], self.yaws + yaw_of(T_map_base)]))
        if len(touched):
            elevation_map.add_obstacle(touched)


def find_depth_dropouts(
    depth: Depth, intrinsics: Intrinsics, T_base_camera: Pose, sensor: SensorModel, near: float
) -> Points:
    """Points in ``base_link``, m, where a thin panel may stand, because ground is seen on both sides but not there.

    A thin upright panel seen edge-on gives no returns, because its face is seen at a grazing angle, and its end may
    be too close to the camera. Its only trace is a stripe without ground in the image, with ground on both sides. If
    no ground is seen below the stripe in the image, the panel may begin anywhere between the stripe and a distance of
    ``near`` m from the robot's centre. The points added in between are as high as the camera, so that they do not
    rule out known ground.
    """
    dropouts = np.zeros_like(depth)
    limits = MIN_GAP_EXTENT, MAX_GAP_WIDTH
    interpolate_dropouts(
        depth, intrinsics.fy, sensor.min_grazing_angle, np.float32(sensor.max_relative_depth_step), *limits, dropouts
    )
    gaps, _ = ndimage.label(dropouts[::ROW_STEP] > 0, np.ones((3, 3)))
    is_panel = [False, *(rows.stop - rows.start >= MIN_GAP_EXTENT for rows, _ in ndimage.find_objects(gaps))]
    v, u = np.nonzero(np.array(is_panel)[gaps])
    v *= ROW_STEP
    missed = transform_points(T_base_camera, intrinsics.rays[v, u] * dropouts[v, u, None])
    # The nearest point in each column, unless the ground is seen below it.
    nearest = len(u) - 1 - np.unique(u[::-1], return_index=True)[1]
    below = [depth[v[n] + ROW_STEP :, u[n]].any() for n in nearest]
    return np.concatenate([missed, _points_before(missed[nearest[~np.array(below, np.bool_)]], T_base_camera, near)])


def _points_before(points: Points, T_base_camera: Pose, near: float) -> Points:
    """Points at the camera's height between the camera and points (N, 3), m, no nearer than ``near`` to the robot."""
    camera = T_base_camera[:3, 3]
    fractions = np.arange(0.0, 1.0, FRACTION_STEP)[:, None, None]
    between = (camera + fractions * (points - camera)).reshape(-1, 3)
    between[:, 2] = camera[2]
    return between[np.hypot(*between.T[:2]) >= near].astype(np.float32)


def find_overhangs(frame: Frame, points: Points, headroom: float) -> NDArray[np.uint8]:
    """The state of the space above a frame's returns (N, 3), m in ``base_link``, up to ``headroom`` m.

    A table top just below the camera is seen at such a grazing angle that it gives no returns, so its column shows
    only the floor below it. Its edge does give returns, which hide part of the space straight above that floor.

    Returns:
        (N,) states of ``overhangs_kernels``: ``ROOFED`` if a nearer surface hides part of the space, ``OPEN`` if the
        frame sees through all of it, or ``UNSURE``.
    """
    k = frame.intrinsics
    sensor = frame.sensor
    in_camera = transform_points(inverse(frame.T_base_camera), points).astype(np.float64)
    up = (frame.T_odom_base[:3, :3] @ frame.T_base_camera[:3, :3])[2].copy()
    noise = NOISE_SIGMAS * sensor.sigma(in_camera[:, 2])
    limits = overhangs_kernels.Limits(
        headroom=headroom,
        nearest=sensor.nearest,
        farthest=sensor.farthest - sensor.margin,
        min_depth_difference=MIN_DEPTH_DIFFERENCE,
        max_overhang=MAX_OVERHANG,
        min_pixels=MIN_PIXELS,
        min_side_extent=MIN_SIDE_EXTENT,
        min_sill_height=MIN_SILL_HEIGHT,
    )
    return overhangs_kernels.states_above(
        in_camera, noise, frame.depth, np.array([k.fx, k.fy, k.cx, k.cy]), up, limits
    )
