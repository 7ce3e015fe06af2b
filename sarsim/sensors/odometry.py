"""Where the robot believes to be, by its wheels and its inertial sensors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.transforms import from_rotation

_GRAVITY = 9.81


@dataclass(frozen=True)
class OdometryConfig:
    """The odometry and its errors; the defaults make it drift by some per cent of the distance.

    Attributes:
        wheel_radius: m, rolling, as the odometry believes it.
        levelling_time: s in which roll and pitch follow the accelerometer.
        gyro_bias: rad/s, standard deviation of a constant bias of each axis, drawn once.
        gyro_noise: rad/s/√Hz.
        accelerometer_bias: m/s², standard deviation of a constant bias of each axis, drawn once.
        accelerometer_noise: m/s²/√Hz.
        scale_error: standard deviation of the relative error of the distance (worn or soft tyres), drawn once.
        slip: m/√m, random walk of the distance by slipping wheels.
    """

    wheel_radius: float = 0.1105
    levelling_time: float = 5.0
    gyro_bias: float = 3e-4
    gyro_noise: float = 3e-4
    accelerometer_bias: float = 0.03
    accelerometer_noise: float = 0.003
    scale_error: float = 0.01
    slip: float = 0.01

    @classmethod
    def ideal(cls) -> "OdometryConfig":
        """The same odometry with sensors that make no error."""
        return cls(
            gyro_bias=0, gyro_noise=0, accelerometer_bias=0, accelerometer_noise=0, scale_error=0, slip=0
        )


class WheelOdometry:
    """Dead reckoning in 3D: the encoders give the distance, the gyro the direction, the accelerometer what is level.

    ``odom`` begins where the robot stands at the first update, turned so that its z is up and its x the robot's yaw.
    """

    def __init__(self, rng: np.random.Generator, config: OdometryConfig | None = None) -> None:
        """``rng`` draws the biases now and the noise of every update."""
        self.config = config or OdometryConfig()
        self._rng = rng
        self._gyro_bias = self.config.gyro_bias * rng.standard_normal(3)
        self._accelerometer_bias = self.config.accelerometer_bias * rng.standard_normal(3)
        self._scale = 1.0 + self.config.scale_error * rng.standard_normal()
        self._R: NDArray[np.float64] | None = None
        self._position = np.zeros(3)
        self._angle = np.zeros(2)
        self._gyro = np.zeros(3)

    @property
    def T_odom_base(self) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``odom``; the identity before the first update."""
        return np.eye(4) if self._R is None else from_rotation(self._R, self._position)

    def update(
        self,
        wheel_angle: NDArray[np.float64],
        gyro: NDArray[np.float64],
        accelerometer: NDArray[np.float64],
        dt: float,
    ) -> NDArray[np.float64]:
        """Take one set of measurements and return ``T_odom_base``; the first one only says where to begin.

        Args:
            wheel_angle: (2,) rad, unwrapped, of the left and right wheels.
            gyro: (3,) rad/s in ``base_link``.
            accelerometer: (3,) m/s² in ``base_link``, gravity included.
            dt: s since the last update.
        """
        accelerometer = self._measure_acceleration(accelerometer, dt)
        if self._R is None:
            self._R = level(accelerometer)
        else:
            self._advance(self._R, wheel_angle, self._measure_rotation(gyro, dt), accelerometer, dt)
        self._angle = np.array(wheel_angle)
        self._gyro = np.array(gyro)
        return self.T_odom_base

    def _advance(
        self,
        R: NDArray[np.float64],
        wheel_angle: NDArray[np.float64],
        rotation: NDArray[np.float64],
        accelerometer: NDArray[np.float64],
        dt: float,
    ) -> None:
        """Move along the mean direction of the period, by the midpoint rule."""
        rotation = rotation + self._levelling(R, accelerometer) * dt
        half = rotation_matrix(rotation / 2)
        self._position = self._position + R @ half[:, 0] * self._distance(wheel_angle)
        self._R = R @ half @ half

    def _distance(self, wheel_angle: NDArray[np.float64]) -> float:
        """Metres forward since the last update, as the slipping wheels tell them."""
        distance = self.config.wheel_radius * float(np.mean(wheel_angle - self._angle)) * self._scale
        return distance + self.config.slip * np.sqrt(abs(distance)) * self._rng.standard_normal()

    def _measure_rotation(self, gyro: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        """(3,) rad turned since the last update, as the gyro tells them: its bias and noise integrated."""
        noise = self.config.gyro_noise * np.sqrt(dt) * self._rng.standard_normal(3)
        return ((self._gyro + gyro) / 2 + self._gyro_bias) * dt + noise

    def _measure_acceleration(self, true: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        noise = self.config.accelerometer_noise / np.sqrt(dt) * self._rng.standard_normal(3)
        return true + self._accelerometer_bias + noise

    def _levelling(self, R: NDArray[np.float64], accelerometer: NDArray[np.float64]) -> NDArray[np.float64]:
        """(3,) rad/s that turn the believed vertical towards the felt one; none while the robot is being shaken.

        The proportional part of a complementary filter (Mahony, Hamel and Pflimlin 2008).
        """
        norm = np.linalg.norm(accelerometer)
        if abs(norm - _GRAVITY) > 0.1 * _GRAVITY:
            return np.zeros(3)
        return np.cross(accelerometer / norm, R[2]) / self.config.levelling_time


def level(accelerometer: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) attitude of zero yaw of a resting body that feels this acceleration, in ``base_link``."""
    up = accelerometer / np.linalg.norm(accelerometer)
    left = np.cross(up, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left)
    return np.array([np.cross(left, up), left, up])


def rotation_matrix(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) rotation by a (3,) rotation vector, rad (Rodrigues' formula)."""
    x, y, z = rotation
    angle = np.sqrt(x * x + y * y + z * z)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    half_sinc = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half_sinc * half_sinc * K @ K
