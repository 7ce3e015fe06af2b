"""Estimate the vertical from the floor that a camera sees, for recordings that do not contain it otherwise."""

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.localisation.registration import LEAST_POINTS
from pipeline.transforms import from_rotation, inverse

FLOOR_STRIDE = 6
"""Pixels; every sixth row and column is enough."""
TRIALS = 400
"""RANSAC samples of three points; if a fifth of the points lie on the floor, one sample lies on it with 96 %."""
STEEPEST = np.cos(np.deg2rad(60))
"""Cosine of the greatest angle between the floor's normal and the image's upward direction."""
LEAST_FLOOR = 0.05
"""Least share of the returns that lie on the floor."""
MOST_BELOW = 0.02
"""Greatest share of the returns that lie below the floor: a table has a floor below."""


def T_floor_camera(frame: Frame) -> NDArray[np.float64]:
    """4×4 pose of ``camera_optical`` over the floor that it sees: level, x forward, the origin below the camera.

    Of the planes that face upward in the image and have nothing below, the floor is the one with most returns.

    Raises:
        InputError: there is no such plane, or too few returns.
    """
    depth = frame.depth[::FLOOR_STRIDE, ::FLOOR_STRIDE]
    shown = depth > 0
    points = frame.intrinsics.rays[::FLOOR_STRIDE, ::FLOOR_STRIDE][shown].astype(np.float64) * depth[shown, None]
    if len(points) < LEAST_POINTS:
        raise InputError(f"the frame at {frame.time:.2f} s shows too little to tell which way is up")
    tolerance = 3 * frame.sensor.sigma(points[:, 2])
    best, most = None, LEAST_FLOOR * len(points)
    rng = np.random.default_rng(0)
    for sample in rng.integers(0, len(points), (TRIALS, 3)):
        plane = _plane(points[sample])
        height = points @ plane[:3] + plane[3]
        on = np.abs(height) < tolerance
        if -plane[1] > STEEPEST and on.sum() > most and np.mean(height < -3 * tolerance) < MOST_BELOW:
            best, most = on, on.sum()
    if best is None:
        raise InputError(f"the frame at {frame.time:.2f} s shows no floor to tell which way is up")
    middle = points[best].mean(axis=0)
    up = np.linalg.svd(points[best] - middle, full_matrices=False)[2][2]
    up *= -np.sign(up[1])
    return T_level_camera(up, float(up @ middle))


def T_level_camera(up: NDArray[np.float64], floor: float) -> NDArray[np.float64]:
    """4×4 pose of ``camera_optical`` over a floor: level, x forward where it looks, the origin below the camera.

    Args:
        up: (3,) the vertical in ``camera_optical``, of length 1.
        floor: m along it from the camera, below 0.
    """
    left = np.cross(up, [0.0, 0.0, 1.0])
    left /= np.linalg.norm(left)
    return inverse(from_rotation(np.column_stack([np.cross(left, up), left, up]), floor * up))


def _plane(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4,) normal that points up in the image, and offset, of the plane through (3, 3) points."""
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    normal *= -np.sign(normal[1]) / max(float(np.linalg.norm(normal)), np.finfo(np.float64).eps)
    return np.append(normal, -normal @ points[0])
