"""The drive's firmware, which converts velocity commands to wheel speeds."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.robot import Velocity

MAX_WHEEL_SPEED_RATIO = 1.2
"""Ratio of the maximum wheel speed to the wheel speed at ``top_speed``; the surplus is for feedback."""
HEADING_GAIN = 4.0
"""1/s, turn rate per radian of heading error."""
MAX_HEADING_ERROR = 0.2
"""rad, maximum heading error that accumulates while the robot cannot turn as commanded."""
WHEEL_GAIN = 10.0
"""1/s, additional wheel speed per radian of a wheel's lag."""
MAX_WHEEL_LAG = 0.03
"""rad, maximum lag that accumulates while a wheel cannot turn as commanded."""
HEADING_TOLERANCE = math.radians(0.2)
"""rad; a stationary robot does not correct a smaller heading error."""
HEADING_TIMEOUT = 1.0
"""s, time after which a stationary robot stops correcting its heading, because something holds the robot."""


@dataclass(frozen=True)
class DriveModel:
    """Parameters of a drive's firmware.

    Attributes:
        wheel_radius: rolling radius, m.
        effective_track: track of the two-wheeled vehicle that turns like the robot, m. It is wider than the robot's
            own track because the tyres slip sideways. With equal loads and Coulomb friction, it is
            ``track + wheelbase² / track``.
        top_speed, top_turn_rate: limits to which faster commands are clipped, m/s and rad/s.
        acceleration, turn_acceleration: maximum accelerations, m/s² and rad/s².
    """

    wheel_radius: float
    effective_track: float
    top_speed: float
    top_turn_rate: float
    acceleration: float
    turn_acceleration: float

    @property
    def limits(self) -> tuple[float, float]:
        """Top speed and turn rate, m/s and rad/s."""
        return self.top_speed, self.top_turn_rate


class SkidSteerController:
    """Follows a velocity command with limited acceleration, using feedback from the gyro and the encoders.

    Call ``command`` once per control period. Gyro feedback holds the heading, and encoder feedback the wheel speeds.
    The heading error is the integral of the commanded minus the measured turn rate, so that a turn ends at the
    commanded heading even though the tyres slip.

    Attributes:
        heading_error: angle by which the robot still has to turn to reach the heading commanded so far, rad.
    """

    def __init__(self, drive: DriveModel) -> None:
        self._drive = drive
        self._v = 0.0
        self._omega = 0.0
        self.heading_error = 0.0
        self._stopped_for = 0.0
        self._wheel_target = self._wheel_lag = [0.0, 0.0]

    def command(
        self, velocity: Velocity, wheel_speed: NDArray[np.float64], gyro_z: float, dt: float
    ) -> NDArray[np.float64]:
        """(2,) rad/s, target speeds of the left and right wheels for the next ``dt`` seconds.

        Args:
            velocity: the command, which is clipped to the limits.
            wheel_speed: (2,) rad/s, measured speeds of the left and right wheels.
            gyro_z: measured turn rate about the robot's vertical axis, rad/s.
            dt: time since the last call, s.
        """
        self._hold_heading(gyro_z, dt)
        self._follow(velocity, dt)
        sides = zip(self._wheel_lag, self._wheel_target, wheel_speed.tolist(), strict=True)
        self._wheel_lag = [_clip(lag + (target - speed) * dt, MAX_WHEEL_LAG) for lag, target, speed in sides]
        self._wheel_target = self._wheel_speeds()
        return np.array([w + WHEEL_GAIN * lag for w, lag in zip(self._wheel_target, self._wheel_lag, strict=True)])

    def _follow(self, velocity: Velocity, dt: float) -> None:
        """Move the reference velocity towards the command within the acceleration limits."""
        drive = self._drive
        self._v = _approach(self._v, velocity.v, drive.top_speed, drive.acceleration * dt)
        self._omega = _approach(self._omega, velocity.omega, drive.top_turn_rate, drive.turn_acceleration * dt)

    def _hold_heading(self, gyro_z: float, dt: float) -> None:
        error = self.heading_error + (self._omega - gyro_z) * dt
        self.heading_error = _clip(error, MAX_HEADING_ERROR)
        is_stopped = self._v == 0.0 and self._omega == 0.0
        self._stopped_for = self._stopped_for + dt if is_stopped else 0.0
        if is_stopped and (abs(self.heading_error) < HEADING_TOLERANCE or self._stopped_for > HEADING_TIMEOUT):
            self.heading_error = 0.0

    def _wheel_speeds(self) -> list[float]:
        """[left, right] rad/s, wheel speeds; if one is too high, both are scaled down to keep the curvature."""
        turn = self._omega + HEADING_GAIN * self.heading_error
        side = turn * self._drive.effective_track / 2
        sides = self._v - side, self._v + side
        excess = max(1.0, max(map(abs, sides)) / (MAX_WHEEL_SPEED_RATIO * self._drive.top_speed))
        return [v / self._drive.wheel_radius / excess for v in sides]


def _clip(value: float, limit: float) -> float:
    return -limit if value < -limit else limit if value > limit else value


def _approach(value: float, target: float, limit: float, step: float) -> float:
    """``value``, moved by at most ``step`` towards ``target`` clipped to ±``limit``."""
    return value + _clip(_clip(target, limit) - value, step)
