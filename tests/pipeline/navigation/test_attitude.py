import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.labels import RAMP_TILT
from pipeline.navigation.navigator import Attitude
from pipeline.transforms import from_rotation, roll_pitch_of

angles = st.floats(-0.6, 0.6)
DT = 0.04


def gravity(R: np.ndarray) -> np.ndarray:
    return R.T @ [0, 0, 9.81]


@settings(max_examples=30, deadline=None)
@given(angles, angles, st.floats(-3, 3))
def test_at_rest_it_gives_the_tilt_of_the_pose(roll, pitch, yaw):
    R, attitude = Rotation.from_euler("xyz", (roll, pitch, yaw)).as_matrix(), Attitude()
    for _ in range(150):
        attitude.update(np.zeros(3), gravity(R), DT)
    np.testing.assert_allclose(attitude.tilt, roll_pitch_of(from_rotation(R, np.zeros(3))), atol=1e-3)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (-1, 0, 0)])
def test_the_gyro_shows_it_at_once(axis):
    attitude, rate = Attitude(), np.array(axis, float)
    for _ in range(5):
        attitude.update(rate, np.zeros(3), DT)  # thrown up, the robot is in free fall
    np.testing.assert_allclose(attitude.tilt, 0.2 * rate[:2], atol=0.01)
    assert attitude.tilt_in(0.1) == pytest.approx(0.3, abs=0.01)
    assert attitude.tilt_in(9.0) == pytest.approx(0.2 + RAMP_TILT, abs=0.01)


def test_a_bump_is_no_tilt():
    attitude = Attitude()
    attitude.update(np.zeros(3), np.array([8.0, 0, 9.81]), DT)
    assert attitude.tilt == (0.0, 0.0)


def test_braking_is_hardly_one():
    attitude = Attitude()
    for _ in range(25):
        attitude.update(np.zeros(3), np.array([-0.3, 0, 9.81]), DT)
    assert abs(attitude.tilt[1]) < np.deg2rad(2)
