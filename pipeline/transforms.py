"""Rigid transforms as 4×4 matrices; ``T_a_b`` transforms coordinates from frame b to frame a."""

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Direction, Points, Pose, Rotation3

Angle = TypeVar("Angle", float, NDArray[np.floating])
FARTHEST = 8192.0  # m from the origin of a frame; up to here float32 resolves 1 mm
POSE_REQUIREMENT = f"a rigid 4 × 4 pose matrix (rotation, translation within ±{FARTHEST:g} m, last row 0 0 0 1)"


def are_poses(T: ArrayLike) -> bool:
    """Whether (..., 4, 4) matrices are poses as ``POSE_REQUIREMENT`` defines them; rotations may be off by 1e-4."""
    T = np.asarray(T, np.float64)
    if T.shape[-2:] != (4, 4) or not np.isfinite(T).all() or np.abs(T).max(initial=0) > FARTHEST:
        return False
    R = T[..., :3, :3]
    is_orthonormal = np.abs(R @ R.swapaxes(-1, -2) - np.eye(3)).max(initial=0) <= 1e-4
    return bool(is_orthonormal and (np.linalg.det(R) > 0).all() and (T[..., 3, :] == (0, 0, 0, 1)).all())


def transform_points(T: Pose, points: NDArray) -> Points:
    """(N, 3) points, m, transformed by ``T``, in single precision.

    Maps, which must be bit-identical when they are rebuilt from stored points, use the kernel
    :func:`pipeline.geometry.moving_kernels.moved` instead.
    """
    R, t = T[:3, :3].astype(np.float32), T[:3, 3].astype(np.float32)
    x, y, z = points.astype(np.float32, copy=False).T
    # This is not a matrix product, because for three columns, waking BLAS's threads takes longer than the product.
    return np.stack([R[i, 0] * x + R[i, 1] * y + R[i, 2] * z + t[i] for i in range(3)], axis=1)


def transform_places(T: NDArray[np.float64], places: NDArray[np.floating]) -> NDArray[np.float64]:
    """(..., 3) places, m, transformed by ``T``, of which only the first three rows are used, in double precision."""
    return places @ T[:3, :3].T + T[:3, 3]


def inverse(T: Pose) -> Pose:
    """Inverse of a rigid transform."""
    return from_rotation(T[:3, :3].T, -T[:3, :3].T @ T[:3, 3])


def from_rotation(R: ArrayLike, t: ArrayLike) -> Pose:
    """The transform with the 3×3 rotation ``R`` and the translation ``t`` (3,), m."""
    result = np.zeros((4, 4))
    result[:3, :3], result[:3, 3], result[3, 3] = R, t, 1
    return result


def orthonormal(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 4, 4) transforms with the nearest rotations; rounding scales the products of many transforms."""
    result = T.copy()
    u, _, v = np.linalg.svd(T[..., :3, :3])
    result[..., :3, :3] = u @ v
    return result


def from_yaw(x: float, y: float, z: float, yaw: float) -> Pose:
    """The transform of a level body at (x, y, z) m with heading ``yaw`` rad."""
    c, s = np.cos(yaw), np.sin(yaw)
    return from_rotation([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, z])


def yaw_of(T: Pose) -> float:
    """Yaw of a pose in rad, (−π, π]."""
    return float(np.arctan2(T[1, 0], T[0, 0]))


def angle_of(T: Pose) -> float:
    """Rotation angle of a transform, rad, [0, π]."""
    return float(np.arccos(np.clip((np.trace(T[:3, :3]) - 1) / 2, -1, 1)))


def roll_pitch_of(T: Pose) -> tuple[float, float]:
    """Roll and pitch of a pose in rad (REP 103: x forward, y left, z up; pitch is positive nose down)."""
    return float(np.arctan2(T[2, 1], T[2, 2])), float(-np.arcsin(np.clip(T[2, 0], -1, 1)))


def rotation_from_up(up: Direction, forward: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Rotation3:
    """Rotation of a body with zero yaw, from the direction ``up`` measured in its frame and its ``forward`` axis."""
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    return np.array([np.cross(left, up), left, up])


def wrap_angle(angle: Angle) -> Angle:
    """The same angle, or angles (N, ...), in [−π, π), rad."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
