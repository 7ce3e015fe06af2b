"""Where the robot believes to be, by its wheels and its inertial sensors."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.transforms import from_rotation
from sarsim.robots.skid_steer import WHEEL_RADIUS

GRAVITY = 9.81
"""m/s²."""
LEVELLING_TIME = 5.0
"""s in which roll and pitch follow the accelerometer."""
GYRO_BIAS = 3e-4
"""rad/s, standard deviation of a constant bias of each axis, drawn once."""
GYRO_NOISE = 3e-4
"""rad/s/√Hz."""
ACCELEROMETER_BIAS = 0.03
"""m/s², standard deviation of a constant bias of each axis, drawn once."""
ACCELEROMETER_NOISE = 0.003
"""m/s²/√Hz."""
SCALE_ERROR = 0.01
"""Standard deviation of the relative error of the distance (worn or soft tyres), drawn once."""
SLIP = 0.01
"""m/√m, random walk of the distance by slipping wheels. With these errors the pose drifts by some per cent."""


class WheelOdometry:
    """Dead reckoning in 3D: the encoders give the distance, the gyro the direction, the accelerometer what is level.

    ``odom`` begins where the robot stands at the first update, turned so that its z is up and its x the robot's yaw.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        """``rng`` draws the biases now and the noise of every update."""
        self._rng = rng
        self._gyro_bias = GYRO_BIAS * rng.standard_normal(3)
        self._accelerometer_bias = ACCELEROMETER_BIAS * rng.standard_normal(3)
        self._scale = 1.0 + SCALE_ERROR * rng.standard_normal()
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
        half = Rotation.from_rotvec(rotation / 2).as_matrix()
        self._position = self._position + R @ half[:, 0] * self._distance(wheel_angle)
        self._R = R @ half @ half

    def _distance(self, wheel_angle: NDArray[np.float64]) -> float:
        """Metres forward since the last update, as the slipping wheels tell them."""
        distance = WHEEL_RADIUS * float(np.mean(wheel_angle - self._angle)) * self._scale
        return distance + SLIP * np.sqrt(abs(distance)) * self._rng.standard_normal()

    def _measure_rotation(self, gyro: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        """(3,) rad turned since the last update, as the gyro tells them: its bias and noise integrated."""
        noise = GYRO_NOISE * np.sqrt(dt) * self._rng.standard_normal(3)
        return ((self._gyro + gyro) / 2 + self._gyro_bias) * dt + noise

    def _measure_acceleration(self, true: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        noise = ACCELEROMETER_NOISE / np.sqrt(dt) * self._rng.standard_normal(3)
        return true + self._accelerometer_bias + noise

    def _levelling(self, R: NDArray[np.float64], accelerometer: NDArray[np.float64]) -> NDArray[np.float64]:
        """(3,) rad/s that turn the believed vertical towards the felt one; none while the robot is being shaken.

        The proportional part of a complementary filter (Mahony, Hamel and Pflimlin 2008).
        """
        norm = np.linalg.norm(accelerometer)
        if abs(norm - GRAVITY) > 0.1 * GRAVITY:
            return np.zeros(3)
        return np.cross(accelerometer / norm, R[2]) / LEVELLING_TIME


def level(accelerometer: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) attitude of zero yaw of a resting body that feels this acceleration, in ``base_link``."""
    up = accelerometer / np.linalg.norm(accelerometer)
    left = np.cross(up, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left)
    return np.array([np.cross(left, up), left, up])
