"""Dead reckoning by hand and in the simulator; run with -s to see what it costs."""

from dataclasses import replace

import numpy as np
import pytest
from dm_control import composer, mjcf
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.errors import InputError
from pipeline.robot import Velocity
from pipeline.transforms import inverse, roll_pitch_of, wrap_angle, yaw_of
from sarsim.robots.skid_steer import SkidSteerController
from sarsim.robots.skid_steered import SkidSteerRobot
from sarsim.sensors import odometry as module
from sarsim.sensors.inertial import MTI_300_GYRO, InertialErrorModel
from sarsim.sensors.odometry import LEVELLING_TIME, TICKS_PER_TURN, WheelOdometry, rotation_from_up
from tests.sarsim.sensors.no_noise import NoNoise

DT = 0.02
UP = np.array([0.0, 0.0, 9.81])
NO_TURN = np.zeros(3)
RADIUS = 0.1105
TICK = 2 * np.pi * RADIUS / TICKS_PER_TURN

components = st.floats(-3, 3)


def ideal() -> WheelOdometry:
    return WheelOdometry(NoNoise(), RADIUS)


def drive(odometry: WheelOdometry, v: float, omega: float, seconds: float) -> np.ndarray:
    """Drive on level ground with wheels that do not slip; returns the estimated pose at the end."""
    angle, half_track, gyro = np.zeros(2), 0.29, np.array([0.0, 0.0, omega])
    T = odometry.update(angle, gyro, UP, DT)
    for _ in range(round(seconds / DT)):
        angle = angle + np.array([v - omega * half_track, v + omega * half_track]) * DT / RADIUS
        T = odometry.update(angle, gyro, UP + np.array([0.0, v * omega, 0.0]), DT)
    return T


@given(roll=st.floats(-0.6, 0.6), pitch=st.floats(-0.6, 0.6))
def test_level_finds_roll_and_pitch(roll, pitch):
    true = Rotation.from_euler("ZYX", [0, pitch, roll]).as_matrix()
    assert_allclose(rotation_from_up(true.T @ UP / np.linalg.norm(UP)), true, atol=1e-12)


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
    assert_allclose(T[:3, 3], [np.cos(pitch), 0, -np.sin(pitch)], atol=TICK)


def test_first_update_says_where_to_begin():
    odometry = ideal()
    assert np.array_equal(odometry.T_odom_base, np.eye(4))
    T = odometry.update(np.array([50.0, 70.0]), NO_TURN, UP, DT)
    assert_allclose(T, np.eye(4))


def test_accelerometer_levels_a_tilted_belief():
    odometry = ideal()
    wrong = Rotation.from_euler("ZYX", [0, 0.05, -0.1]).as_matrix()
    odometry.update(np.zeros(2), NO_TURN, wrong.T @ UP, DT)
    tilts = [np.hypot(*roll_pitch_of(odometry.update(np.zeros(2), NO_TURN, UP, DT))) for _ in range(1500)]
    assert_allclose(tilts[round(LEVELLING_TIME / DT) - 1] / np.hypot(0.05, 0.1), np.exp(-1), rtol=0.02)
    assert np.all(np.diff(tilts) < 0)


@pytest.mark.parametrize("forward", [0.3, -0.3])
def test_setting_off_is_not_a_tilt(forward):
    """Where wheels and gyros explain the accelerometer, no tilt does."""
    odometry, yaw_rate = ideal(), 0.5
    for k in range(150):
        v, angle = forward * k * DT, forward * (k * DT) ** 2 / 2 / RADIUS
        felt = UP + np.array([forward, v * yaw_rate, 0.0])
        T = odometry.update(np.full(2, angle), np.array([0.0, 0.0, yaw_rate]), felt if k else UP, DT)
    assert np.hypot(*roll_pitch_of(T)) < np.radians(0.02)


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
    for rate in rates[1:]:
        T = odometry.update(np.zeros(2), rate, UP, DT)
        true = true * Rotation.from_rotvec(rate * DT)
    assert_allclose(T[:3, :3], true.as_matrix(), atol=1e-9)


def test_same_seed_gives_the_same_drift():
    runs = [drive(WheelOdometry(np.random.default_rng(7), RADIUS), 0.2, 0.1, 10.0) for _ in range(2)]
    assert np.array_equal(*runs)


def test_encoders_count_whole_ticks():
    odometry, tick = ideal(), 2 * np.pi / TICKS_PER_TURN
    believed = [odometry.update(np.full(2, k * tick), NO_TURN, UP, DT)[0, 3] for k in (0.5, 0.9, 1.1, 3.5, -0.5)]
    assert_allclose(np.divide(believed, TICK), [0, 0, 1, 3, -1], atol=1e-9)
    assert_allclose(TICK, 1e-3 / 49, rtol=0.01)


WAYS = [
    ((0.2, 0.0, 100.0), (0.05, 0.02, 0.1), (0.5, 0.15, 0.8)),
    ((0.0, 0.5, 10 * np.pi / 0.5), (0.005, 0.0, 1.5), (0.1, 0.01, 7.0)),
]
"""Command (m/s, rad/s) and its time in s; least and most of the median errors."""


class Plane(composer.Arena):
    def _build(self) -> None:
        self._mjcf_root = mjcf.RootElement("plane")
        self._mjcf_root.worldbody.add("geom", type="plane", size=(0, 0, 0.1))


def driven(v: float, omega: float, seconds: float) -> list[tuple[NDArray[np.float64], ...]]:
    """True values of encoders, gyros and accelerometers, and the true pose, at 5 Hz, of a command in the physics."""
    plane, robot, ways = Plane(), SkidSteerRobot(), []
    firmware = SkidSteerController(robot.drive)
    plane.add_free_entity(robot)
    physics = mjcf.Physics.from_mjcf_model(plane.mjcf_model)
    for k in range(round((seconds + 1.0) / DT)):
        command = Velocity(v, omega) if k * DT >= 1.0 else Velocity()
        wheels = firmware.command(command, robot.wheel_speed(physics), robot.gyro(physics)[2], DT)
        physics.bind(robot.actuators).ctrl = wheels
        physics.step(round(DT / physics.timestep()))
        if k * DT >= 0.5 and k % 10 == 0:
            sensed = robot.wheel_angle(physics), robot.gyro(physics), robot.accelerometer(physics)
            ways.append((*map(np.array, sensed), robot.T_world_base(physics)))
    return ways


def errors(ways: list[tuple[NDArray[np.float64], ...]], seed: int) -> NDArray[np.float64]:
    """(3,) errors of the odometry at the end: m along the ground, m upwards and degrees of heading."""
    odometry = WheelOdometry(np.random.default_rng(seed), RADIUS)
    for wheels, gyro, accelerometer, _ in ways:
        believed = odometry.update(wheels, gyro, accelerometer, 10 * DT)
    true = inverse(ways[0][3]) @ ways[-1][3]
    x, y, z = believed[:3, 3] - true[:3, 3]
    return np.array([np.hypot(x, y), abs(z), abs(np.degrees(wrap_angle(yaw_of(believed) - yaw_of(true))))])


@pytest.mark.parametrize(("motion", "at_least", "at_most"), WAYS, ids=["20 m", "five turns"])
def test_what_a_way_costs(motion, at_least, at_most):
    way = driven(*motion)
    wrong = np.array([errors(way, seed) for seed in range(10)])
    median, worst = np.median(wrong, axis=0), wrong.max(axis=0)
    print(f"\nmedian {median.round(3)}, worst {worst.round(3)} (m, m upwards, degrees)")
    assert (at_least <= median).all() and (median <= at_most).all()


ERROR_FIELDS = ("noise_density", "bias_stability", "bias_sigma", "scale_sigma")
SHEETS = [f"{kind} {error}" for kind in ("GYRO", "ACCELEROMETER") for error in ERROR_FIELDS]
ERRORS = ("TYRE_ERROR", "SIDE_ERROR", "SLIP")


@pytest.mark.parametrize("error", [*SHEETS, *ERRORS])
def test_each_error_alone_makes_it_drift(error, monkeypatch):
    for other in {*ERRORS} - {error}:
        monkeypatch.setattr(module, other, 0.0)
    for kind in ("GYRO", "ACCELEROMETER"):
        name = f"MTI_300_{kind}"
        only = {error.split()[1]: getattr(getattr(module, name), error.split()[1])} if kind in error else {}
        monkeypatch.setattr(module, name, InertialErrorModel(**only))
    believed = drive(WheelOdometry(np.random.default_rng(1), RADIUS), 0.2, 0.1, 10.0)
    drift = np.linalg.norm(believed - drive(ideal(), 0.2, 0.1, 10.0))
    # A scale error turns the vertical only where the robot accelerates: here, sideways, by 0.06 m/s².
    least, most = (0.0, 1e-6) if error == "ACCELEROMETER scale_sigma" else (1e-6, 0.1)
    assert least < drift < most


def test_a_gyro_that_reads_too_much_turns_too_far(monkeypatch):
    errors = replace(MTI_300_GYRO, noise_density=0.0, bias_stability=0.0, bias_sigma=0.0)
    monkeypatch.setattr(module, "MTI_300_GYRO", errors)
    rng = np.random.default_rng(4)
    scale = 1 + MTI_300_GYRO.scale_sigma * np.random.default_rng(4).standard_normal(3)
    assert_allclose(yaw_of(drive(WheelOdometry(rng, RADIUS), 0.0, 0.5, 2.0)), scale[2], atol=1e-4)


@pytest.mark.parametrize("error", [-0.02, 0.02])
def test_a_wheel_larger_than_the_robot_knows_measures_ways_too_long(error: float) -> None:
    known, unknown = (WheelOdometry(NoNoise(), RADIUS, e) for e in (0.0, error))
    right, wrong = (drive(odometry, 0.2, 0.0, 10.0)[0, 3] for odometry in (known, unknown))
    assert wrong == pytest.approx((1 + error) * right, rel=1e-6)


@pytest.mark.parametrize("error", [0.2, -1.0, np.nan])
def test_another_wheel_is_no_error(error: float) -> None:
    with pytest.raises(InputError, match=rf"tyre_error must be .* -0\.2 .* 0\.2, not {error:g}"):
        WheelOdometry(NoNoise(), RADIUS, error)
