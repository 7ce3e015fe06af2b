"""A drive through a room: true poses, an odometry that drifts, and what the camera sees."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.transforms import from_yaw, inverse
from tests.pipeline.polygon_scene import HALF, Face, floor, look, pose, wall

T_BASE_CAMERA = pose(0.1, 0.0, 0.6, 0.0, down=0.25)
ROOM = [
    floor(0, 5, 0, 4),
    *(wall(a, b) for a, b in (((0, 0), (5, 0)), ((5, 0), (5, 4)), ((5, 4), (0, 4)), ((0, 4), (0, 0)))),
    wall((2.5, 1.6), (2.5, 2.4)),
]


def drive(*moves: tuple[float, float]) -> list[NDArray[np.float64]]:
    """Poses of a robot that starts at (1.2, 1) m and with each move drives by m, then turns by rad."""
    poses = [from_yaw(1.2, 1.0, 0.0, 0.0)]
    for way, turn in moves:
        poses.append(poses[-1] @ from_yaw(way, 0.0, 0.0, turn))
    return poses


def drifting(poses: list[NDArray[np.float64]], stretch: float = 1.0, veer: float = 0.0) -> list[NDArray[np.float64]]:
    """Poses as a drifting odometry measures them: ways times ``stretch``, and turned by ``veer`` rad per move."""
    odometry = [poses[0]]
    for a, b in pairwise(poses):
        move = inverse(a) @ b
        move[:3, 3] *= stretch
        odometry.append(odometry[-1] @ move @ from_yaw(0.0, 0.0, 0.0, veer))
    return odometry


def seen(
    T_world_base: NDArray[np.float64], T_odom_base: NDArray[np.float64], time: int = 0, faces: list[Face] = ROOM
) -> Frame:
    """The frame that a robot takes at a pose, with 5 mm of noise."""
    T = T_world_base @ T_BASE_CAMERA
    frame = look(faces, T, sigma=0.005, seed=time, reach=(0.5, 3.5), camera=HALF)
    return replace(frame, time=float(time), T_base_camera=T_BASE_CAMERA, T_odom_base=T_odom_base)
