"""How far the robot leans, by its gyro and accelerometer alone."""

import numpy as np
from numpy.typing import NDArray
from scipy.constants import g

from pipeline.navigation.config import AttitudeConfig


class Attitude:
    """A complementary filter: the gyro turns the vertical, the accelerometer corrects it slowly.

    Attributes:
        up: (3,) unit vector of the vertical in ``base_link``.
        rate: (2,) rad/s at which roll and pitch change.
    """

    def __init__(self, config: AttitudeConfig = AttitudeConfig()) -> None:
        self._config = config
        self.up, self.rate = np.array([0.0, 0.0, 1.0]), np.zeros(2)

    def update(self, gyro: NDArray[np.float64], accelerometer: NDArray[np.float64], dt: float) -> None:
        """Take (3,) rad/s and (3,) m/s², gravity included, of the last ``dt`` s into account."""
        self.rate = gyro[:2]
        up = self.up - np.cross(gyro, self.up) * dt
        size = float(np.linalg.norm(accelerometer))
        if abs(size - g) < self._config.most_disturbance:
            up = up + (accelerometer / size - up) * min(1.0, dt / self._config.time_constant)
        self.up = up / np.linalg.norm(up)

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch in rad (REP 103: pitch is positive nose down)."""
        x, y, z = self.up
        return float(np.arctan2(y, z)), float(np.arcsin(np.clip(-x, -1, 1)))

    def tilt_in(self, seconds: float) -> float:
        """The larger of roll and pitch, rad, if both go on changing at the present rate, but not far."""
        most = self._config.most_change
        return float(np.abs(np.array(self.tilt) + np.clip(self.rate * seconds, -most, most)).max())
