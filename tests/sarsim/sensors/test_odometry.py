from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from pipeline.transforms import tilt_of, yaw_of
from sarsim.robots.skid_steer import WHEEL_RADIUS as RADIUS
from sarsim.sensors import odometry as module
from sarsim.sensors.odometry import LEVELLING_TIME, WheelOdometry, level
from tests.sarsim.sensors.no_noise import NoNoise

DT = 0.02
UP = np.array([0.0, 0.0, 9.81])
NO_TURN = np.zeros(3)

components = st.floats(-3, 3)


def ideal() -> WheelOdometry:
    return WheelOdometry(NoNoise())


def drive(odometry: WheelOdometry, v: float, omega: float, seconds: float) -> np.ndarray:
    """Drive on level ground with wheels that do not slip; the believed pose at the end."""
    angle, half_track, gyro = np.zeros(2), 0.29, np.array([0.0, 0.0, omega])
    T = odometry.update(angle, gyro, UP, DT)
    for _ in range(round(seconds / DT)):
        angle = angle + np.array([v - omega * half_track, v + omega * half_track]) * DT / RADIUS
        T = odometry.update(angle, gyro, UP, DT)
    return T


@given(roll=st.floats(-0.6, 0.6), pitch=st.floats(-0.6, 0.6))
def test_level_finds_roll_and_pitch(roll, pitch):
    true = Rotation.from_euler("ZYX", [0, pitch, roll]).as_matrix()
    assert_allclose(level(true.T @ UP), true, atol=1e-12)


def test_straight_ahead():
    T = drive(ideal(), 0.2, 0.0, 5.0)
    assert_allclose(T[:3, 3], [1.0, 0, 0], atol=1e-9)
    assert_allclose(T[:3, :3], np.eye(3), atol=1e-12)


def test_turn_in_place():
    T = drive(ideal(), 0.0, 0.5, 2.0)
    assert_allclose(T[:3, 3], 0, atol=1e-12)
    assert_allclose(yaw_of(T), 1.0)


def test_quarter_circle():
    v, omega = 0.2, 0.1 * np.pi
    T = drive(ideal(), v, omega, 5.0)
    assert_allclose(T[:3, 3], [v / omega, v / omega, 0], atol=1e-4)


def test_up_a_slope():
    pitch = np.radians(-16.1)
    gravity = Rotation.from_euler("y", pitch).as_matrix().T @ UP
    odometry = ideal()
    odometry.update(np.zeros(2), NO_TURN, gravity, DT)
    T = odometry.update(np.full(2, 1.0 / RADIUS), NO_TURN, gravity, DT)
    assert_allclose(T[:3, 3], [np.cos(pitch), 0, -np.sin(pitch)], atol=1e-9)


def test_first_update_says_where_to_begin():
    odometry = ideal()
    assert np.array_equal(odometry.T_odom_base, np.eye(4))
    T = odometry.update(np.array([50.0, 70.0]), NO_TURN, UP, DT)
    assert_allclose(T, np.eye(4))


def test_accelerometer_levels_a_tilted_belief():
    odometry = ideal()
    wrong = Rotation.from_euler("ZYX", [0, 0.05, -0.1]).as_matrix()
    odometry.update(np.zeros(2), NO_TURN, wrong.T @ UP, DT)
    tilts = [np.hypot(*tilt_of(odometry.update(np.zeros(2), NO_TURN, UP, DT))) for _ in range(1500)]
    assert_allclose(tilts[round(LEVELLING_TIME / DT) - 1] / np.hypot(0.05, 0.1), np.exp(-1), rtol=0.02)
    assert np.all(np.diff(tilts) < 0)


def test_shaken_accelerometer_is_not_believed():
    odometry = ideal()
    odometry.update(np.zeros(2), NO_TURN, UP, DT)
    for _ in range(100):
        T = odometry.update(np.zeros(2), NO_TURN, np.array([9.0, 0.0, 9.81]), DT)
    assert_allclose(T, np.eye(4), atol=1e-12)


@given(st.lists(st.tuples(components, components, components), min_size=1, max_size=50))
def test_attitude_stays_a_rotation(rates):
    odometry = ideal()
    for rate in rates:
        R = odometry.update(np.zeros(2), np.array(rate), UP, DT)[:3, :3]
    assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert_allclose(np.linalg.det(R), 1.0)


def test_gyro_alone_agrees_with_scipy(monkeypatch):
    monkeypatch.setattr(module, "LEVELLING_TIME", np.inf)
    rates = np.random.default_rng(3).uniform(-1, 1, (200, 3))
    odometry = ideal()
    true = Rotation.identity()
    odometry.update(np.zeros(2), rates[0], UP, DT)
    for before, rate in pairwise(rates):
        T = odometry.update(np.zeros(2), rate, UP, DT)
        true = true * Rotation.from_rotvec((before + rate) / 2 * DT)
    assert_allclose(T[:3, :3], true.as_matrix(), atol=1e-9)


def test_same_seed_gives_the_same_drift():
    runs = [drive(WheelOdometry(np.random.default_rng(7)), 0.2, 0.1, 10.0) for _ in range(2)]
    assert np.array_equal(*runs)


def test_drifts_by_some_per_cent_of_the_distance():
    truth = drive(ideal(), 0.2, 0.02, 150.0)
    drifts = []
    for seed in range(8):
        believed = drive(WheelOdometry(np.random.default_rng(seed)), 0.2, 0.02, 150.0)
        drifts.append(100 * np.linalg.norm(believed[:3, 3] - truth[:3, 3]) / (0.2 * 150))
    print(f"\ndrift over 30 m: median {np.median(drifts):.1f} %, worst {max(drifts):.1f} %")
    assert 0.3 < np.median(drifts) < 4
    assert max(drifts) < 10


ERRORS = ("GYRO_BIAS", "GYRO_NOISE", "ACCELEROMETER_BIAS", "SCALE_ERROR", "SLIP")


@pytest.mark.parametrize("error", ERRORS)
def test_each_error_alone_makes_it_drift(error, monkeypatch):
    for other in {*ERRORS, "ACCELEROMETER_NOISE"} - {error}:
        monkeypatch.setattr(module, other, 0.0)
    believed = drive(WheelOdometry(np.random.default_rng(1)), 0.2, 0.1, 10.0)
    drift = np.linalg.norm(believed[:3, 3] - drive(ideal(), 0.2, 0.1, 10.0)[:3, 3])
    assert 1e-5 < drift < 0.5
