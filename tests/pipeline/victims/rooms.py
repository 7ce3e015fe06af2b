"""A room for tests: a floor, a wall, and balls as people, seen by an ideal RGB-D camera."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame, Intrinsics
from pipeline.transforms import from_rotation, inverse
from pipeline.victims.detection import Detection

INTRINSICS = Intrinsics(160, 120, 144.0, 144.0, 80.0, 60.0)
WALL, HEIGHT = 4.0, 0.6
"""m from the origin to the wall, along x; m from the floor to the camera."""
OPTICAL = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
Ball = tuple[float, float, float, float]
"""x, y, z of its middle and its radius, m."""


def camera_at(x: float, y: float) -> NDArray[np.float64]:
    """4×4 T_map_camera of a level camera that looks along x."""
    return from_rotation(OPTICAL, [x, y, HEIGHT])


def step(T_map_camera: NDArray[np.float64], balls: Sequence[Ball] = ()) -> Frame:
    """What the camera sees; T_base_camera is as if the base were the map's origin."""
    rays = INTRINSICS.rays.astype(np.float64)
    directions = rays @ T_map_camera[:3, :3].T
    origin = T_map_camera[:3, 3]
    with np.errstate(divide="ignore"):
        floor = np.where(directions[..., 2] < 0, -origin[2] / directions[..., 2], np.inf)
        depth = np.minimum(floor, (WALL - origin[0]) / directions[..., 0])
    for *centre, radius in balls:
        depth = np.minimum(depth, _ball(directions, np.array(centre) - origin, radius))
    rgb = np.zeros((INTRINSICS.height, INTRINSICS.width, 3), np.uint8)
    return Frame(0.0, rgb, depth.astype(np.float32), INTRINSICS, T_map_camera, np.eye(4))


def _ball(directions: NDArray[np.float64], centre: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Depth of its front, infinite beside it."""
    along, square = directions @ centre, (directions**2).sum(axis=-1)
    root = along**2 - square * (centre @ centre - radius**2)
    return np.where((root >= 0) & (along > 0), (along - np.sqrt(np.maximum(root, 0))) / square, np.inf)


def detection_of(T_map_camera: NDArray[np.float64], ball: Ball, confidence: float = 0.9) -> Detection:
    """The box around a ball, to about a pixel."""
    x, y, z = (inverse(T_map_camera) @ [*ball[:3], 1])[:3]
    u, v, r = 80 + 144 * x / z, 60 + 144 * y / z, 144 * ball[3] / z
    return Detection((u - r, v - r, u + r, v + r), confidence)
