"""The robot's pose by dead reckoning with its wheel encoders and inertial sensors."""

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose, Rotation3
from pipeline.errors import InputError
from pipeline.transforms import from_rotation, rotation_from_up
from sarsim.sensors.inertial import GRAVITY, MTI_300_ACCELEROMETER, MTI_300_GYRO, InertialTriad

TICKS_PER_TURN = 34_000
"""Encoder ticks per wheel turn, 49 per millimetre (Pioneer 3 operations manual, P3-AT); assumed for other robots."""
LEVELLING_TIME = 5.0
"""s, time constant with which roll and pitch follow the accelerometer."""
TYRE_ERROR = 0.01
"""Standard deviation of the relative error of the tyres' rolling radius, which varies with pressure, load and wear.
``TYRE_ERROR``, ``SIDE_ERROR`` and ``SLIP`` are chosen; the manual only says to measure the ticks per millimetre."""
SIDE_ERROR = 0.003
"""Standard deviation of the additional relative error of the radius of each side's tyres."""
MAX_TYRE_ERROR = 0.2
"""Limit of the relative error; beyond it, the tyre would be of another size."""
SLIP = 0.01
"""m/√m, random walk of each side's distance, which represents dust and bumps that the smooth simulated floor lacks.
The physics itself simulates how the tyres scrub in a turn."""


class WheelOdometry:
    """Dead reckoning in 3D with distance from encoders, direction from gyros and the vertical from accelerometers.

    The origin of ``odom`` is the robot's position at the first update; its z is up and its x along the robot's yaw.
    """

    def __init__(self, rng: np.random.Generator, wheel_radius: float, tyre_error: float = 0.0) -> None:
        """Start at the origin of ``odom``.

        Args:
            rng: draws the constant errors at once, and the noise of every update.
            wheel_radius: rolling radius, m.
            tyre_error: relative error of the radius, unknown to the robot, in addition to those drawn from ``rng``.

        Raises:
            InputError: the magnitude of ``tyre_error`` is not below ``MAX_TYRE_ERROR``.
        """
        if not abs(tyre_error) < MAX_TYRE_ERROR:
            raise InputError(
                f"tyre_error must be greater than -{MAX_TYRE_ERROR:g} and less than {MAX_TYRE_ERROR:g},"
                f" not {tyre_error:g}"
            )
        self._rng = rng
        self._gyros = InertialTriad(MTI_300_GYRO, rng)
        self._accelerometers = InertialTriad(MTI_300_ACCELEROMETER, rng)
        self._radius = wheel_radius * (
            1.0 + tyre_error + TYRE_ERROR * rng.standard_normal() + SIDE_ERROR * rng.standard_normal(2)
        )
        self._R: NDArray[np.float64] | None = None
        self._position = np.zeros(3)
        self._ticks = np.zeros(2)
        self._speed = 0.0

    @property
    def T_odom_base(self) -> Pose:
        """Pose of ``base_link`` in ``odom``; the identity before the first update."""
        return np.eye(4) if self._R is None else from_rotation(self._R, self._position)

    def update(
        self,
        wheel_angle: NDArray[np.float64],
        gyro: NDArray[np.float64],
        accelerometer: NDArray[np.float64],
        dt: float,
    ) -> NDArray[np.float64]:
        """Process one set of measurements and return ``T_odom_base``; the first set only sets the initial pose.

        Args:
            wheel_angle: (2,) rad, unwrapped angles of the left and right wheels.
            gyro: (3,) rad/s, mean turn rates since the last update, in ``base_link``.
            accelerometer: (3,) m/s², mean acceleration since the last update, gravity included, in ``base_link``.
            dt: time since the last update, s.
        """
        gyro = self._gyros.measure(gyro, dt)
        accelerometer = self._accelerometers.measure(accelerometer, dt)
        ticks = np.floor(wheel_angle * TICKS_PER_TURN / (2 * np.pi))
        if self._R is None:
            self._R = rotation_from_up(accelerometer / np.linalg.norm(accelerometer))
        else:
            rolled = (ticks - self._ticks) * (2 * np.pi / TICKS_PER_TURN) * self._radius
            speed = float(rolled.mean()) / dt
            # Setting off at 0.3 m/s² would otherwise look like a tilt of 1.8°.
            gravity = accelerometer - acceleration_of(self._speed, speed, gyro, dt)
            turn = gyro + self._levelling(self._R, gravity)
            self._advance(self._R, self._distance(rolled), turn * dt)
            self._speed = speed
        self._ticks = ticks
        return self.T_odom_base

    def _advance(self, R: Rotation3, distance: float, rotation: NDArray[np.float64]) -> None:
        """Move along the mean direction of the period, by the midpoint rule."""
        half = _rotation(rotation / 2)
        self._position = self._position + R @ half[:, 0] * distance
        self._R = R @ half @ half

    def _distance(self, rolled: NDArray[np.float64]) -> float:
        """Distance driven forward, m: the mean of both sides' distances ``rolled`` (2,) m, with random errors."""
        left, right = (rolled + SLIP * np.sqrt(np.abs(rolled)) * self._rng.standard_normal(2)).tolist()
        return (left + right) / 2

    def _levelling(self, R: Rotation3, accelerometer: NDArray[np.float64]) -> NDArray[np.float64]:
        """(3,) rad/s, rates that turn the estimated vertical towards the measured one; 0 while the robot is shaken.

        This is the proportional part of a complementary filter (Mahony, Hamel and Pflimlin 2008).
        """
        norm = math.sqrt(accelerometer @ accelerometer)
        if abs(norm - GRAVITY) > 0.1 * GRAVITY:
            return np.zeros(3)
        (x, y, z), (a, b, c) = (accelerometer / norm).tolist(), R[2].tolist()
        return np.array([y * c - z * b, z * a - x * c, x * b - y * a]) / LEVELLING_TIME


def acceleration_of(before: float, speed: float, gyro: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
    """(3,) m/s² in ``base_link``, acceleration of wheels that roll without slipping sideways.

    Args:
        before, speed: speed of the wheels, m/s, ``dt`` s ago and now.
        gyro: (3,) rad/s, turn rates in ``base_link``.
        dt: time between the two speeds, s.
    """
    return np.array([(speed - before) / dt, speed * gyro[2], -speed * gyro[1]])


def _rotation(rotvec: NDArray[np.float64]) -> Rotation3:
    """Matrix of a rotation vector (3,) rad, by SciPy's formulas without the checks that take 90% of SciPy's time."""
    x, y, z = rotvec.tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    scale = math.sin(angle / 2) / angle if angle > 1e-3 else 0.5 - angle**2 / 48 + angle**4 / 3840
    x, y, z, w = x * scale, y * scale, z * scale, math.cos(angle / 2)
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )
