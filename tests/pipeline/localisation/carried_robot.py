"""Rooms of polygons, a robot that is set down in them, and the maps of a tour."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame
from pipeline.metric_map.metric_map import MetricMap
from pipeline.sensor import XTION
from pipeline.transforms import from_rotation, from_yaw, inverse
from tests.pipeline.polygon_scene import HALF, Face, floor, look, pose, wall, wedge
from tests.pipeline.robot_model import PIONEER

T_BASE_CAMERA = pose(0.1, 0.0, 0.6, 0.0, down=0.25)
RAMP_RISE, RAMP_LENGTH = 0.2, 1.2

BARE = [
    floor(0, 5, 0, 4),
    *(wall(a, b) for a, b in (((0, 0), (5, 0)), ((5, 0), (5, 4)), ((5, 4), (0, 4)), ((0, 4), (0, 0)))),
]
"""A room that looks the same turned by half a turn."""
ROOM = [*BARE, wall((2, 0), (2, 1.5)), wall((3.4, 4), (3.4, 3.2)), *wedge(3.6, 1, RAMP_LENGTH, 1, RAMP_RISE)]
"""The same room with two partitions and a ramp, which distinguish its ends."""
HALL = [
    floor(0, 6, 0, 3),
    *(wall(a, b) for a, b in (((0, 0), (6, 0)), ((6, 0), (6, 3)), ((6, 3), (0, 3)), ((0, 3), (0, 0)))),
]
HALL += [wall((1.5, 3), (2.5, 2)), wall((4, 0), (4, 1))]
"""Another arena."""


def on_ramp(yaw: float) -> NDArray[np.float64]:
    """4×4 pose of a robot in the middle of ROOM's ramp, turned by ``yaw`` rad from uphill."""
    slope = np.arctan2(RAMP_RISE, RAMP_LENGTH)
    c, s = np.cos(slope), np.sin(slope)
    T = from_rotation([[c, 0, -s], [0, 1, 0], [s, 0, c]], (4.2, 1.0, RAMP_RISE / 2))
    return T @ from_yaw(0, 0, 0, yaw)


def seen(
    faces: list[Face], T_map_base: NDArray[np.float64], T_map_odom: NDArray[np.float64] | None = None, seed: int = 0
) -> Frame:
    """The frame that a robot takes, whose odometry began at ``T_map_odom``."""
    reach = XTION.nearest, XTION.farthest
    frame = look(faces, T_map_base @ T_BASE_CAMERA, sigma=0.01, seed=seed, reach=reach, camera=HALF)
    T_odom_base = T_map_base if T_map_odom is None else inverse(T_map_odom) @ T_map_base
    return replace(frame, T_base_camera=T_BASE_CAMERA, T_odom_base=T_odom_base)


@dataclass
class Maps:
    """The maps that a robot has of a room."""

    metric_map: MetricMap = field(default_factory=MetricMap)
    elevation_map: ElevationMap = field(default_factory=lambda: ElevationMap(PIONEER))
    clouds: list[NDArray[np.float32]] = field(default_factory=list)

    @property
    def points(self) -> NDArray[np.float32]:
        return np.vstack(self.clouds)

    def add(self, faces: list[Face], poses: Iterable[NDArray[np.float64]]) -> "Maps":
        for n, T_map_base in enumerate(poses):
            frame, T_map_camera = seen(faces, T_map_base, seed=n), T_map_base @ T_BASE_CAMERA
            points = frame.points(T_map_camera)
            self.metric_map.integrate(frame.depth, frame.intrinsics, T_map_camera)
            self.elevation_map.update(points)
            self.clouds.append(points[::4])
        return self


def tour(places: Iterable[tuple[float, float]]) -> list[NDArray[np.float64]]:
    """Poses of full turns at each of some places, m."""
    return [from_yaw(x, y, 0.0, yaw) for x, y in places for yaw in np.arange(6) * np.pi / 3]


WEST, EAST = [(0.8, 0.8), (0.8, 3.0)], [(2.6, 2.2), (3.0, 0.6), (4.2, 2.8)]


@cache
def room() -> Maps:
    """The whole of ROOM; tests leave it as it is."""
    return Maps().add(ROOM, tour(WEST + EAST))
