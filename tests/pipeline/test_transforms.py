import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.transforms import (
    FARTHEST,
    are_poses,
    from_rotation,
    from_yaw,
    inverse,
    orthonormal,
    roll_pitch_of,
    transform_points,
    wrap_angle,
    yaw_of,
)

angles = st.floats(-3, 3)


@given(angles, st.floats(-1.4, 1.4), angles)
def test_roll_pitch_and_yaw_are_those_of_rep_103(roll, pitch, yaw):
    T = from_rotation(Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix(), [1, 2, 3])
    np.testing.assert_allclose([*roll_pitch_of(T), yaw_of(T)], [roll, pitch, yaw], atol=1e-9)


@given(angles, angles)
def test_the_inverse_undoes(yaw, x):
    T = from_yaw(x, 1, 2, yaw)
    np.testing.assert_allclose(T @ inverse(T), np.eye(4), atol=1e-12)


def test_points_move_with_the_frame():
    moved = transform_points(from_yaw(1, 0, 0.5, np.pi / 2), np.array([[1, 0, 0]], np.float32))
    np.testing.assert_allclose(moved, [[1, 1, 0.5]], atol=1e-6)
    assert moved.dtype == np.float32


@pytest.mark.parametrize(("angle", "expected"), [(0, 0), (np.pi, -np.pi), (4, 4 - 2 * np.pi), (-7, 2 * np.pi - 7)])
def test_angles_wrap(angle, expected):
    assert wrap_angle(angle) == pytest.approx(expected)


def test_rounding_is_taken_from_a_rotation():
    T = from_yaw(1.0, 2.0, 3.0, 0.4)
    rough = T.copy()
    rough[:3, :3] *= 1 + 1e-5
    assert np.abs(rough - T).max() > 5e-6
    np.testing.assert_allclose(orthonormal(rough), T, atol=1e-12)


def test_poses_are_rigid_finite_and_near():
    poses = np.stack([from_yaw(FARTHEST, 0, -FARTHEST, 1), np.eye(4)])
    assert are_poses(poses) and are_poses(poses[0]) and are_poses(np.zeros((0, 4, 4)))
    for place, value in (
        ((1, 0, 3), FARTHEST + 1),
        ((1, 2, 3), np.nan),
        ((0, 3, 0), 1e-9),
        ((1, 0, 0), 1.01),
        ((1, 0, 0), -1),
    ):
        bad = poses.copy()
        bad[place] = value
        assert not are_poses(bad), (place, value)
    assert not are_poses(np.eye(3))
