"""Predictions of motion by an odometry with known errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.localisation.config import OdometryConfig
from pipeline.localisation.localisation import OdometryErrors
from pipeline.localisation.motion_model import POSE_SLICE, MeasuredMotion, MotionModel
from pipeline.localisation.registration import logarithm
from pipeline.transforms import from_rotation, from_yaw, inverse, yaw_of

EXACT = 1e10 * np.eye(6)
CONFIG = OdometryConfig()
EXPECTED = OdometryErrors.expected(CONFIG)
numbers = st.floats(-1, 1)


def believing(errors: NDArray[np.float64]) -> MotionModel:
    model = MotionModel(CONFIG)
    model.learn(OdometryErrors(np.asarray(errors), EXPECTED.covariance))
    return model


def motion_of(rng: np.random.Generator) -> MeasuredMotion:
    """A random motion between keyframes: up to 15° either way and 0.3 m ahead, on ground of up to 15°."""
    up = np.append(rng.uniform(-0.18, 0.18, 2), 0.96)
    return MeasuredMotion(from_yaw(rng.uniform(0, 0.3), 0, 0, rng.uniform(-0.26, 0.26)), up / np.linalg.norm(up), 1.0)


def test_before_anything_is_learnt_a_motion_is_the_odometrys() -> None:
    motion = MeasuredMotion(from_yaw(0.3, 0.01, 0.0, 0.1), np.array([0.0, 0.0, 1.0]), 1.0)
    start = from_yaw(2.0, 3.0, 0.0, 1.0)
    prediction = MotionModel(CONFIG).predict(start, motion)
    np.testing.assert_allclose(prediction.T_map_base, start @ motion.T, atol=1e-12)
    assert not EXPECTED.errors[:3].any()


@pytest.mark.parametrize("turned", [0.5, -0.5, np.pi / 2, -2 * np.pi, 8.0])
def test_a_slide_in_a_turn_is_the_sum_of_the_slides_in_its_parts(turned: float) -> None:
    """The parts are 1000 small turns, in which the robot's axes hardly move."""
    slope = np.deg2rad(16)
    up, downhill = np.array([0.0, np.sin(slope), np.cos(slope)]), np.array([0.0, -np.sin(slope), 0.0])
    straight, along_axle, of_pivot = np.zeros((3, 3))
    step = turned / 1000
    for middle in step * (np.arange(1000) + 0.5):
        x, y = (np.array([np.cos(middle + a), np.sin(middle + a), 0.0]) for a in (0, np.pi / 2))
        straight += abs(step) * downhill
        along_axle += abs(step) * (downhill @ y) * y
        of_pivot -= step * (downhill @ x) * y
    motion = MeasuredMotion(from_yaw(0, 0, 0, turned), up, 1.0, turned * np.cos(slope))
    slid = MotionModel(CONFIG).predict(np.eye(4), motion).T_map_base[:3, 3]
    np.testing.assert_allclose(slid, CONFIG.slide * (straight + along_axle + of_pivot), atol=1e-5)
    one_each = believing(np.array([0, 0, 0, 0.1, 0.2, 0.3, 0])).predict(np.eye(4), motion).T_map_base[:3, 3]
    np.testing.assert_allclose(one_each, 0.1 * straight + 0.2 * along_axle + 0.3 * of_pivot, atol=1e-5)


def test_a_robot_is_not_expected_to_slide_where_it_only_pitches_but_is_less_certain() -> None:
    """On the foot of a ramp, its tyres do not scrub; at an edge, it may drop."""
    nose_up = np.array([np.sin(0.1), 0.0, np.cos(0.1)])
    T = from_rotation(Rotation.from_rotvec([0, -0.2, 0]).as_matrix(), np.array([0.3, 0.0, 0.0]))
    onto, level = (MeasuredMotion(T, up, 1.0) for up in (nose_up, np.array([0.0, 0.0, 1.0])))
    np.testing.assert_allclose(MotionModel(CONFIG).predict(np.eye(4), onto).T_map_base, T, atol=1e-12)
    added = (CONFIG.slide_noise * np.sin(0.1) * 0.2) ** 2
    assert onto.noise(CONFIG)[4, 4] == pytest.approx(level.noise(CONFIG)[4, 4] + added)


def test_where_nothing_is_registered_errors_of_the_gyro_add_up() -> None:
    """20 blind turns of 15° are as unsure as the gyro's scale over all of them; a registration ends that."""
    motion = MeasuredMotion(from_yaw(0, 0, 0, np.pi / 12), np.array([0.0, 0.0, 1.0]), 1.0)
    model, T = MotionModel(CONFIG), np.eye(4)
    for _ in range(20):
        prediction = model.predict(T, motion)
        T = prediction.T_map_base
        model.update(prediction, None)
    assert np.sqrt(prediction.covariance[2, 2]) == pytest.approx(0.005 * 20 * np.pi / 12, rel=0.1)
    model.update(prediction, EXACT)
    after = model.predict(T, motion)
    np.testing.assert_allclose(
        after.covariance[POSE_SLICE, POSE_SLICE], after.motion_covariance, rtol=1e-3, atol=1e-9
    )


def test_along_a_corridor_a_pose_is_as_unsure_as_one_motion() -> None:
    """Relative to what the last keyframe saw: registration determines all but x."""
    along = np.diag([1e8, 1e8, 1e8, 0, 1e8, 1e8])
    motion = MeasuredMotion(from_yaw(0.3, 0, 0, 0), np.array([0.0, 0.0, 1.0]), 1.0)
    model, T = MotionModel(CONFIG), np.eye(4)
    for _ in range(20):
        prediction = model.predict(T, motion)
        T = prediction.T_map_base
        model.update(prediction, along)
    assert prediction.covariance[3, 3] == pytest.approx(2 * prediction.motion_covariance[3, 3], rel=0.01)


def test_whole_turns_between_keyframes_count() -> None:
    """1.6 turns by a gyro that measures 0.7% too much end 4° before the measured heading, not 1.5° after it."""
    turned = 1.6 * 2 * np.pi
    motion = MeasuredMotion(from_yaw(0, 0, 0, turned), np.array([0.0, 0.0, 1.0]), 20.0, turned)
    np.testing.assert_allclose(motion.turn, [0, 0, turned], atol=1e-9)
    np.testing.assert_allclose(
        MeasuredMotion(inverse(motion.T), motion.up, 20.0, -turned).turn, [0, 0, -turned], atol=1e-9
    )
    T = believing(np.array([0, -0.007, 0, 0.4, 0, 0, 0])).predict(np.eye(4), motion).T_map_base
    assert yaw_of(from_yaw(0, 0, 0, -turned) @ T) == pytest.approx(-0.007 * turned)


@pytest.mark.parametrize("slope_deg", [5, 15])
def test_more_than_half_a_turn_on_a_slope_is_the_same_turn(slope_deg: float) -> None:
    slope, turned = np.deg2rad(slope_deg), np.deg2rad(200.0)
    up = np.array([np.sin(slope), 0.0, np.cos(slope)])
    motion = MeasuredMotion(from_yaw(0, 0, 0, turned), up, 5.0, turned * np.cos(slope))
    np.testing.assert_allclose(motion.turn, [0, 0, turned], atol=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 0.1])
@pytest.mark.parametrize("turned", [2 * np.pi, -2 * np.pi])
def test_a_full_turn_is_about_the_vertical_although_it_ends_at_the_same_heading(tilt: float, turned: float) -> None:
    T = from_rotation(Rotation.from_rotvec([tilt, 0, 0]).as_matrix(), np.zeros(3))
    motion = MeasuredMotion(T, np.array([0.0, 0.0, 1.0]), 20.0, turned)
    np.testing.assert_allclose(motion.turn, [tilt, 0, turned], atol=1e-9)
    after = believing(np.array([0, 0.002, 0, 0, 0, 0, 0])).predict(np.eye(4), motion).T_map_base
    assert yaw_of(after) == pytest.approx(0.002 * turned, rel=0.01)
    np.testing.assert_allclose(after[2, :3], T[2, :3], atol=1e-3)


def test_after_a_restart_a_pose_is_as_sure_as_given() -> None:
    model, motion = MotionModel(CONFIG), motion_of(np.random.default_rng(2))
    sure = np.diag(model.predict(np.eye(4), motion).covariance)[:6]
    model.restart(0.04 * np.eye(6))
    assert (np.diag(model.predict(np.eye(4), motion).covariance)[:6] - sure > 0.039).all()


def test_what_was_learnt_makes_the_next_motion_surer() -> None:
    motion, model = motion_of(np.random.default_rng(2)), MotionModel(CONFIG)
    before = model.predict(np.eye(4), motion).motion_covariance
    model.learn(OdometryErrors(EXPECTED.errors, np.zeros((7, 7))))
    after = model.predict(np.eye(4), motion).motion_covariance
    np.testing.assert_allclose(after, motion.noise(CONFIG))
    assert (np.diag(after)[2:5] < np.diag(before)[2:5]).all()


def test_a_motion_is_as_unsure_as_the_way_the_turn_and_the_slope_make_it() -> None:
    level, slope = np.array([0.0, 0.0, 1.0]), np.array([0.28, 0.0, 0.96])
    far, near, turn = from_yaw(2, 0, 0, 0), from_yaw(0.5, 0, 0, 0), from_yaw(0, 0, 0, 0.5)
    across = {name: np.sqrt(MeasuredMotion(T, up, 1.0).noise(CONFIG)[4, 4]) for name, T, up in (
        ("far", far, level), ("near", near, level), ("turn", turn, level), ("slides", turn, slope)
    )}  # fmt: skip
    assert across["far"] == pytest.approx(2 * across["near"], rel=0.05)
    assert across["turn"] == pytest.approx(across["near"])
    assert across["slides"] > 10 * across["turn"]


@pytest.mark.parametrize("way", [0.3, 2.0])
def test_a_slip_takes_away_any_share_of_the_way(way: float) -> None:
    """Its share is uniform between 0 and 1, so that its mean square is a third."""
    noise = MeasuredMotion(from_yaw(way, 0, 0, 0), np.array([0.0, 0.0, 1.0]), 1.0).noise(CONFIG)
    assert noise[3, 3] - noise[4, 4] == pytest.approx(way / CONFIG.distance_between_slips * way**2 / 3)


@given(numbers, numbers, numbers, st.integers(0, 6))
def test_the_jacobian_is_the_poses_derivative(x: float, y: float, turn: float, k: int) -> None:
    motion = MeasuredMotion(from_yaw(x, y, 0.0, turn), np.array([0.1, 0.2, 0.97]), 2.0)
    step = 1e-6 * np.eye(7)[k]
    a, b = (believing(sign * step).predict(np.eye(4), motion).T_map_base for sign in (-1, 1))
    np.testing.assert_allclose(logarithm(inverse(a) @ b) / 2e-6, motion.jacobian[:, k], atol=1e-6)
