"""How far the robot leans, by its gyro and accelerometer alone."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

GRAVITY = 9.81
MAX_LEAD = np.deg2rad(8)
_LEVEL = np.array([0.0, 0.0, 1.0])


@dataclass
class Attitude:
    """A complementary filter: the gyro turns the direction of up, the accelerometer corrects it slowly.

    Attributes:
        time_constant: s in which up follows the accelerometer, which bumps and braking disturb.
        max_disturbance: m/s²; an acceleration that differs more from gravity tells nothing of up.
        up: (3,) unit vector in ``base_link``.
        rate: (2,) rad/s at which roll and pitch change.
    """

    time_constant: float = 0.5
    max_disturbance: float = 2.0
    up: NDArray[np.float64] = field(default_factory=_LEVEL.copy)
    rate: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))

    def update(self, gyro: NDArray[np.float64], accelerometer: NDArray[np.float64], dt: float) -> None:
        """Take (3,) rad/s and (3,) m/s², gravity included, of the last ``dt`` s into account."""
        self.rate = gyro[:2]
        up = self.up - np.cross(gyro, self.up) * dt
        size = float(np.linalg.norm(accelerometer))
        if abs(size - GRAVITY) < self.max_disturbance:
            up = up + (accelerometer / size - up) * min(1.0, dt / self.time_constant)
        self.up = up / np.linalg.norm(up)

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch in rad (REP 103: pitch is positive nose down)."""
        x, y, z = self.up
        return float(np.arctan2(y, z)), float(np.arcsin(np.clip(-x, -1, 1)))

    def tilt_in(self, seconds: float) -> float:
        """The larger of roll and pitch, in rad, if the robot goes on to turn over as it does now.

        No more than ``MAX_LEAD`` is added: bumps turn it fast, but not far.
        """
        return float(np.abs(np.array(self.tilt) + np.clip(self.rate * seconds, -MAX_LEAD, MAX_LEAD)).max())
