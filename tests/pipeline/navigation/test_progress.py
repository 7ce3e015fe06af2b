"""Whether a robot still makes progress."""

import numpy as np
import pytest

from pipeline.navigation.commands import Turn
from pipeline.navigation.config import ProgressConfig
from pipeline.navigation.navigator import StuckDetector
from pipeline.robot import Velocity
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER

DT = 0.04
CONFIG = ProgressConfig(patience=3.0)


def seconds_until_stuck(command: Velocity, v: float, omega: float, on_ramp: bool = True) -> float:
    """For a robot that moves with ``v`` m/s and ``omega`` rad/s by its odometry; inf if it is never stuck."""
    progress = StuckDetector(PIONEER, from_yaw(0, 0, 0, 0), 0.0, CONFIG)
    for k in range(1, 300):
        if progress.is_stuck(from_yaw(k * DT * v, 0, 0, k * DT * omega), k * DT, command, on_ramp):
            return k * DT
    return np.inf


@pytest.mark.parametrize(
    ("command", "v", "omega", "expected"),
    [
        (Velocity(0.2), 0.2, 0.0, np.inf),
        (Velocity(0.2), 0.0, 0.0, CONFIG.patience),
        (Turn(0.0, 0.3), 0.0, 0.3, np.inf),
        # If a robot is held and the wheels of one side spin, the odometry measures a drive.
        (Turn(0.1, 0.3), 0.12, 0.0, CONFIG.patience),
    ],
)
def test_a_robot_is_stuck_when_what_it_was_commanded_to_change_does_not(command, v, omega, expected):
    assert seconds_until_stuck(command, v, omega) == pytest.approx(expected, abs=2 * DT)


@pytest.mark.parametrize("latency", [0.0, 0.12, 0.24])
@pytest.mark.parametrize("turning", [-0.6, 0.0, 0.6])
def test_a_robot_that_obeys_late_and_still_turns_the_other_way_is_not_held(latency, turning):
    """This happens after a pause in which a robot on a network went on with its last command."""
    progress = StuckDetector(PIONEER, from_yaw(0, 0, 0, 0), 0.0, CONFIG)
    yaw, rate, limit = 0.0, turning, PIONEER.turn_acceleration * DT
    for k in range(1, 100):
        rate += np.clip((0.6 if k * DT > latency else turning) - rate, -limit, limit)
        yaw += rate * DT
        assert not progress.is_stuck(from_yaw(0, 0, 0, yaw), k * DT, Turn(0.0, 0.6))


@pytest.mark.parametrize("command", [Velocity(0.3), Velocity(-0.3), Turn(0.0, 0.6)])
def test_a_robot_that_is_held_is_so_within_a_second(command):
    assert 0.4 < seconds_until_stuck(command, 0.0, 0.0, on_ramp=False) < 1.0


@pytest.mark.parametrize(("v", "turning"), [(0.3, 0.0), (-0.3, 0.0), (0.0, -0.7), (0.3, -0.7)])
def test_a_robot_that_brakes_harder_than_it_should_is_not_held(v, turning):
    """The motion before the turn ends abruptly 0.4 s after the turn was commanded."""
    progress = StuckDetector(PIONEER, from_yaw(0, 0, 0, 0), 0.0, CONFIG)
    x, yaw, rate, limit = 0.0, 0.0, turning, PIONEER.turn_acceleration * DT
    for k in range(1, 100):
        x += v * DT * (k * DT < 0.4)
        rate = turning if k * DT < 0.4 else max(rate, 0.0)
        rate += np.clip(0.6 - rate, 0, limit) * (k * DT >= 0.4)
        yaw += rate * DT
        assert not progress.is_stuck(from_yaw(x, 0, 0, yaw), k * DT, Turn(0.0, 0.6))
