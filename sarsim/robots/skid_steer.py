"""The drive's firmware: from a velocity command to the speed of the wheels."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.robot import Velocity


@dataclass(frozen=True)
class SkidSteerConfig:
    """The P3-AT's drive.

    Attributes:
        wheel_radius: m, rolling.
        effective_track: m. A skid-steered vehicle turns as a two-wheeled one with a wider track would, for its
            tyres slip sideways. With equal loads and Coulomb friction it is
            ``track + wheelbase² / track`` = 0.398 + 0.270² / 0.398.
        max_speed: m/s.
        max_turn_rate: rad/s.
        max_wheel_speed: rad/s; the surplus over ``max_speed`` is what feedback may use.
        acceleration: m/s².
        turn_acceleration: rad/s².
        heading_gain: 1/s, turn rate per radian of heading error.
        max_heading_error: rad remembered while the robot cannot turn as commanded.
        wheel_gain: 1/s, wheel speed per radian by which a wheel lags.
        max_wheel_lag: rad remembered while a wheel cannot turn as commanded.
    """

    wheel_radius: float = 0.1105
    effective_track: float = 0.581
    max_speed: float = 0.7
    max_turn_rate: float = math.radians(140)
    max_wheel_speed: float = 7.5
    acceleration: float = 0.3
    turn_acceleration: float = math.radians(100)
    heading_gain: float = 4.0
    max_heading_error: float = 0.2
    wheel_gain: float = 10.0
    max_wheel_lag: float = 0.03


# Below this heading error, in rad, a stopped robot stops correcting.
_SETTLED = math.radians(0.2)


class SkidSteer:
    """Follows a commanded velocity with limited acceleration; the gyro holds the heading, the encoders the wheels.

    One ``command`` a control period. The heading error is the integral of the turn rate asked for less the one felt,
    so a turn ends where it should although the tyres slip.
    """

    def __init__(self, config: SkidSteerConfig | None = None) -> None:
        self.config = config or SkidSteerConfig()
        self._v = 0.0
        self._omega = 0.0
        self._heading_error = 0.0
        self._wheel_target = np.zeros(2)
        self._wheel_lag = np.zeros(2)

    @property
    def heading_error(self) -> float:
        """How far the robot has still to turn to be where the commands so far should have brought it, rad."""
        return self._heading_error

    def command(
        self, velocity: Velocity, wheel_speed: NDArray[np.float64], gyro_z: float, dt: float
    ) -> NDArray[np.float64]:
        """(2,) rad/s that the left and right wheels shall turn at for the next ``dt`` seconds.

        Args:
            velocity: the command; beyond the limits it is cut to them.
            wheel_speed: (2,) rad/s of the left and right wheels, measured.
            gyro_z: rad/s about the robot's vertical axis, measured.
            dt: s since the last call.
        """
        self._hold_heading(gyro_z, dt)
        self._follow(velocity, dt)
        lag = self._wheel_lag + (self._wheel_target - wheel_speed) * dt
        self._wheel_lag = np.clip(lag, -self.config.max_wheel_lag, self.config.max_wheel_lag)
        self._wheel_target = self._wheels()
        return self._wheel_target + self.config.wheel_gain * self._wheel_lag

    def _follow(self, velocity: Velocity, dt: float) -> None:
        """Move the reference towards the command, no faster than the acceleration limits."""
        config = self.config
        self._v = _approach(self._v, velocity.v, config.max_speed, config.acceleration * dt)
        self._omega = _approach(
            self._omega, velocity.omega, config.max_turn_rate, config.turn_acceleration * dt
        )

    def _hold_heading(self, gyro_z: float, dt: float) -> None:
        limit = self.config.max_heading_error
        self._heading_error = _clip(self._heading_error + (self._omega - gyro_z) * dt, limit)
        stopped = self._v == 0.0 and self._omega == 0.0
        if stopped and abs(self._heading_error) < _SETTLED:
            self._heading_error = 0.0

    def _wheels(self) -> NDArray[np.float64]:
        """(2,) rad/s; where one would be too fast both are slowed alike, which keeps the curvature."""
        config = self.config
        turn = self._omega + config.heading_gain * self._heading_error
        side = turn * config.effective_track / 2
        wheels = np.array([self._v - side, self._v + side]) / config.wheel_radius
        return wheels / max(1.0, np.abs(wheels).max() / config.max_wheel_speed)


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _approach(value: float, target: float, limit: float, step: float) -> float:
    """``value``, moved towards ``target`` cut to ±``limit``, by no more than ``step``."""
    return value + _clip(_clip(target, limit) - value, step)
