"""What a robot learns of its odometry, where registration tells the truth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.localisation.motion_model import MEAN, MeasuredMotion, MotionModel
from pipeline.localisation.registration import Registration, logarithm
from pipeline.transforms import from_yaw, inverse, yaw_of

TRUE = np.array([0.01, -0.007, 0.016, 0.5, 4e-5])
EXACT, NOTHING = 1e10 * np.eye(6), np.zeros((6, 6))
numbers = st.floats(-1, 1)


def believing(parameters: NDArray[np.float64]) -> MotionModel:
    model = MotionModel()
    model.parameters = parameters
    return model


def registered(T: NDArray[np.float64], information: NDArray[np.float64]) -> Registration:
    return Registration(T, information, np.eye(6), 1.0, 0.0)


def motion_of(rng: np.random.Generator) -> MeasuredMotion:
    """A random motion between keyframes: up to 15° either way and 0.3 m ahead, on ground of up to 15°."""
    up = np.append(rng.uniform(-0.18, 0.18, 2), 0.96)
    return MeasuredMotion(from_yaw(rng.uniform(0, 0.3), 0, 0, rng.uniform(-0.26, 0.26)), up / np.linalg.norm(up), 1.0)


def learnt(information: NDArray[np.float64]) -> MotionModel:
    """The model after 300 keyframes, each registered at its true pose with the given information."""
    rng, true, model = np.random.default_rng(4), believing(TRUE), MotionModel()
    for _ in range(300):
        motion = motion_of(rng)
        T = true.predict(np.eye(4), motion).T_map_base
        model.take(model.predict(np.eye(4), motion), registered(T, information))
    return model


def test_before_anything_is_learnt_a_motion_is_the_odometrys() -> None:
    motion = MeasuredMotion(from_yaw(0.3, 0.01, 0.0, 0.1), np.array([0.0, 0.0, 1.0]), 1.0)
    start = from_yaw(2.0, 3.0, 0.0, 1.0)
    prediction = MotionModel().predict(start, motion)
    np.testing.assert_allclose(prediction.T_map_base, start @ motion.T, atol=1e-12)
    assert MEAN[:3] == (0, 0, 0)


def test_a_robot_that_turns_on_a_slope_is_expected_to_slide_downhill() -> None:
    left_side_up = np.array([0.0, np.sin(0.28), np.cos(0.28)])
    motion = MeasuredMotion(from_yaw(0, 0, 0, 0.5), left_side_up, 1.0)
    slid = MotionModel().predict(np.eye(4), motion).T_map_base[:3, 3]
    np.testing.assert_allclose(slid, [0, -MEAN[3] * 0.5 * np.sin(0.28), 0], atol=1e-12)


def test_it_learns_what_is_wrong_with_the_odometry() -> None:
    model = learnt(EXACT)
    assert (np.abs(model.parameters - TRUE) < [0.005, 0.001, 0.006, 0.05, 4e-5]).all()
    motion = motion_of(np.random.default_rng(9))
    true = believing(TRUE).predict(np.eye(4), motion)
    errors = [
        logarithm(inverse(true.T_map_base) @ m.predict(np.eye(4), motion).T_map_base) for m in (model, MotionModel())
    ]
    assert np.linalg.norm(errors[0]) < 0.2 * np.linalg.norm(errors[1])


def test_it_learns_nothing_where_registration_tells_nothing() -> None:
    model, motion = MotionModel(), motion_of(np.random.default_rng(1))
    prediction = model.predict(np.eye(4), motion)
    model.take(prediction, registered(prediction.T_map_base, NOTHING))
    model.take(model.predict(np.eye(4), motion), None)
    np.testing.assert_allclose(model.parameters, MEAN, atol=1e-12)


def test_the_end_of_a_blind_turn_tells_the_scale_of_the_gyro() -> None:
    """After 20 turns of 15°, of which only the last is registered, the heading is 2° short of the odometry's."""
    model, T = MotionModel(), np.eye(4)
    motion = MeasuredMotion(from_yaw(0, 0, 0, np.pi / 12), np.array([0.0, 0.0, 1.0]), 1.0)
    for k in range(20):
        prediction = model.predict(T, motion)
        T = prediction.T_map_base if k < 19 else from_yaw(0, 0, 0, 20 * np.pi / 12 * (1 - 0.007))
        model.take(prediction, registered(T, EXACT) if k == 19 else None)
    assert -0.0072 < model.parameters[1] < -0.006


def test_whole_turns_between_keyframes_count() -> None:
    """1.6 turns by a gyro that measures 0.7 % too much end 4° before the measured heading, not 1.5° after it."""
    turned = 1.6 * 2 * np.pi
    motion = MeasuredMotion(from_yaw(0, 0, 0, turned), np.array([0.0, 0.0, 1.0]), 20.0, turned)
    np.testing.assert_allclose(motion.turn, [0, 0, turned], atol=1e-9)
    np.testing.assert_allclose(
        MeasuredMotion(inverse(motion.T), motion.up, 20.0, -turned).turn, [0, 0, -turned], atol=1e-9
    )
    T = believing([0, -0.007, 0, 0.4, 0]).predict(np.eye(4), motion).T_map_base
    assert yaw_of(from_yaw(0, 0, 0, -turned) @ T) == pytest.approx(-0.007 * turned)


@pytest.mark.parametrize("slope_deg", [5, 15])
def test_more_than_half_a_turn_on_a_slope_is_the_same_turn(slope_deg: float) -> None:
    slope, turned = np.deg2rad(slope_deg), np.deg2rad(200.0)
    up = np.array([np.sin(slope), 0.0, np.cos(slope)])
    motion = MeasuredMotion(from_yaw(0, 0, 0, turned), up, 5.0, turned * np.cos(slope))
    np.testing.assert_allclose(motion.turn, [0, 0, turned], atol=1e-9)


def test_a_loop_that_corrects_keyframes_tells_the_scale_of_the_gyro() -> None:
    model = MotionModel()
    motion = MeasuredMotion(from_yaw(0, 0, 0, np.pi / 12), np.array([0.0, 0.0, 1.0]), 1.0)
    poses = np.array([from_yaw(0, 0, 0, 0.993 * k * np.pi / 12) for k in range(40)])
    model.fit([None, *[motion] * 39], poses)
    assert -0.0072 < model.parameters[1] < -0.006
    unbelievable = MotionModel()
    unbelievable.fit([None] * 40, poses)
    np.testing.assert_allclose(unbelievable.parameters, MEAN)


def test_after_a_restart_a_pose_is_as_sure_as_told() -> None:
    model, motion = MotionModel(), motion_of(np.random.default_rng(2))
    sure = np.diag(model.predict(np.eye(4), motion).covariance)[:6]
    model.restart(0.04 * np.eye(6))
    assert (np.diag(model.predict(np.eye(4), motion).covariance)[:6] - sure > 0.039).all()


def test_what_was_learnt_makes_the_next_motion_surer() -> None:
    motion = motion_of(np.random.default_rng(2))
    before, after = (m.predict(np.eye(4), motion).step for m in (MotionModel(), learnt(EXACT)))
    assert (np.diag(after)[2:5] < np.diag(before)[2:5]).all()  # heading and place; odometry tells the rest as ever


@given(numbers, numbers, numbers, st.integers(0, 4))
def test_the_jacobian_is_the_poses_derivative(x: float, y: float, turn: float, k: int) -> None:
    motion = MeasuredMotion(from_yaw(x, y, 0.0, turn), np.array([0.1, 0.2, 0.97]), 2.0)
    step = 1e-6 * np.eye(5)[k]
    a, b = (believing(sign * step).predict(np.eye(4), motion).T_map_base for sign in (-1, 1))
    np.testing.assert_allclose(logarithm(inverse(a) @ b) / 2e-6, motion.jacobian[:, k], atol=1e-6)
