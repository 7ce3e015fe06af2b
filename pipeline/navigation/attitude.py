"""The tilt of the robot, estimated from its gyro and accelerometer alone."""

import numpy as np
from numpy.typing import NDArray
from scipy.constants import g

from pipeline.navigation.config import AttitudeConfig


class Attitude:
    """A complementary filter: the gyro rotates the estimated vertical, and the accelerometer slowly corrects it.

    Attributes:
        up: (3,) unit vector in ``base_link`` that points vertically upwards.
        rate: (2,) rates of roll and pitch, rad/s.
    """

    def __init__(self, config: AttitudeConfig = AttitudeConfig()) -> None:
        self._config = config
        self.up, self.rate = np.array([0.0, 0.0, 1.0]), np.zeros(2)

    def update(self, gyro: NDArray[np.float64], accelerometer: NDArray[np.float64], dt: float) -> None:
        """Update with (3,) rad/s and (3,) m/s², gravity included, measured over the last ``dt`` s."""
        self.rate = gyro[:2]
        up = self.up - np.cross(gyro, self.up) * dt
        size = float(np.linalg.norm(accelerometer))
        if abs(size - g) < self._config.most_disturbance:
            up = up + (accelerometer / size - up) * min(1.0, dt / self._config.time_constant)
        self.up = up / np.linalg.norm(up)

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch, rad (REP 103: pitch is positive nose down)."""
        x, y, z = self.up
        return float(np.arctan2(y, z)), float(np.arcsin(np.clip(-x, -1, 1)))

    def tilt_in(self, seconds: float) -> float:
        """The larger of roll and pitch in ``seconds`` s, rad, if both keep changing as now, up to a limit."""
        most = self._config.most_change
        return float(np.abs(np.array(self.tilt) + np.clip(self.rate * seconds, -most, most)).max())
