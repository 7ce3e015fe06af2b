import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pipeline.robot import Velocity
from sarsim.robots import skid_steer
from sarsim.robots.skid_steer import MAX_WHEEL_SPEED_RATIO, DriveModel, SkidSteerController

DT = 0.02
STILL = np.zeros(2)
PIONEER = DriveModel(0.1105, 0.581, 0.7, math.radians(140), 0.3, math.radians(100))
MAX_WHEEL_SPEED = MAX_WHEEL_SPEED_RATIO * PIONEER.top_speed / PIONEER.wheel_radius

speeds = st.floats(-2, 2)
rates = st.floats(-5, 5)


class Body:
    """A robot whose wheels reach their speeds at once, and that turns ``obedience`` times as fast as commanded."""

    def __init__(self, obedience: float = 1.0) -> None:
        self.firmware = SkidSteerController(PIONEER)
        self.obedience = obedience
        self.wheels, self.gyro = STILL, 0.0

    def drive(self, seconds: float, v: float = 0.0, omega: float = 0.0) -> np.ndarray:
        """(N, 2) wheel speeds on the way."""
        orders = []
        for _ in range(round(seconds / DT)):
            self.wheels = self.firmware.command(Velocity(v, omega), self.wheels, self.gyro, DT)
            self.gyro = self.obedience * forward_and_turn(self.wheels)[1]
            orders.append(self.wheels)
        return np.array(orders)


def forward_and_turn(wheels: np.ndarray) -> np.ndarray:
    """(..., 2) velocities in m/s and rad/s from (..., 2) wheel speeds in rad/s."""
    left, right = np.moveaxis(wheels * PIONEER.wheel_radius, -1, 0)
    return np.stack([(left + right) / 2, (right - left) / PIONEER.effective_track], axis=-1)


def test_turn_command_turns_the_wheels_against_each_other():
    left, right = Body().drive(2.0, omega=1.0)[-1]
    assert_allclose(right, 0.581 / 2 / 0.1105, rtol=1e-6)
    assert_allclose(left, -right)


def test_speed_ramps_up_at_the_acceleration_limit():
    moved = forward_and_turn(Body().drive(1.0, v=0.6))[:, 0]
    assert_allclose(np.diff(moved), PIONEER.acceleration * DT)


def test_stops_at_the_acceleration_limit():
    body = Body()
    body.drive(2.0, v=0.3)
    wheels = body.drive(1.2)
    assert_allclose(forward_and_turn(wheels)[24, 0], 0.3 - 25 * DT * PIONEER.acceleration)
    assert_allclose(wheels[-1], 0.0, atol=1e-12)


@settings(max_examples=30)
@given(v=speeds, omega=rates)
def test_limits_hold_for_any_command(v, omega):
    wheels = Body().drive(4.0, v, omega)
    assert np.abs(wheels).max() <= MAX_WHEEL_SPEED + skid_steer.WHEEL_GAIN * skid_steer.MAX_WHEEL_LAG
    moved, turned = np.abs(forward_and_turn(wheels)).max(axis=0)
    assert moved <= PIONEER.top_speed + 1e-9
    assert turned <= PIONEER.top_turn_rate * 1.1


@settings(max_examples=30)
@given(v=st.floats(0.3, 0.7), omega=st.floats(1.5, 2.4))
def test_saturated_wheels_keep_the_curvature(v, omega):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(skid_steer, "MAX_WHEEL_SPEED_RATIO", 4.0 * PIONEER.wheel_radius / PIONEER.top_speed)
        patch.setattr(skid_steer, "HEADING_GAIN", 0.0)
        wheels = Body().drive(4.0, v, omega)
    moved, turned = forward_and_turn(wheels)[-1]
    assert_allclose(np.abs(wheels[-1]).max(), 4.0)
    assert_allclose(turned / moved, omega / v)


@settings(max_examples=30)
@given(v=speeds, omega=rates)
def test_mirrored_command_gives_mirrored_wheels(v, omega):
    left_turn = Body().drive(1.0, v, omega)
    right_turn = Body().drive(1.0, v, -omega)
    assert np.array_equal(left_turn, right_turn[:, ::-1])


@pytest.mark.parametrize("obedience", [0.7, 0.9, 1.0, 1.15])
def test_gyro_makes_up_for_tyres_that_slip_more_or_less(obedience):
    body = Body(obedience=obedience)
    wheels = np.concatenate([body.drive(2.0, omega=0.5), body.drive(4.0)])
    turned = obedience * forward_and_turn(wheels)[:, 1].sum() * DT
    assert_allclose(math.degrees(turned), math.degrees(0.5 * 2.0), atol=0.25)


def test_heading_error_of_a_blocked_robot_stays_bounded():
    firmware = SkidSteerController(PIONEER)
    for _ in range(500):
        firmware.command(Velocity(omega=1.0), STILL, 0.0, DT)
    assert firmware.heading_error == skid_steer.MAX_HEADING_ERROR


def test_wheel_that_lags_is_pushed_and_let_go_again():
    firmware = SkidSteerController(PIONEER)
    for _ in range(500):
        wheels = firmware.command(Velocity(v=0.2), STILL, 0.0, DT)
    push = skid_steer.WHEEL_GAIN * skid_steer.MAX_WHEEL_LAG
    assert_allclose(wheels, 0.2 / PIONEER.wheel_radius + push)


def test_wheels_that_roll_back_on_a_slope_are_held():
    """A servo that gives way in proportion to the load: the firmware must bring the creep to an end."""
    firmware, give, wheels = SkidSteerController(PIONEER), np.full(2, -0.05), STILL
    for _ in range(200):
        wheels = firmware.command(Velocity(), wheels, 0.0, DT) + give
    assert_allclose(wheels, 0.0, atol=1e-6)


def test_stopped_robot_does_not_follow_a_drifting_gyro():
    firmware = SkidSteerController(PIONEER)
    orders = [firmware.command(Velocity(), STILL, 1e-3, DT) for _ in range(3000)]
    assert np.abs(orders).max() < 0.01


def test_a_robot_that_something_holds_stops_its_wheels():
    body = Body(obedience=0.0)
    body.drive(2.0, omega=0.5)
    assert np.abs(body.drive(0.5)[-1]).min() > 1.0  # it still tries to reach the heading
    assert_allclose(body.drive(2.0)[-1], 0.0, atol=1e-9)
