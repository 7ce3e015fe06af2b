"""The errors of three gyros or three accelerometers, from the figures of a data sheet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GRAVITY = 9.81  # m/s²
DRIFT_TIME = 100.0
"""s in which a bias forgets; chosen where the Allan deviation of MEMS sensors is flat, for data sheets do not say."""
CALIBRATION_TIME = 10.0
"""s that the robot stands still before it sets off, in which it measures the gyros' bias."""


@dataclass(frozen=True)
class DataSheet:
    """Of each axis; the unit is rad/s or m/s².

    Attributes:
        noise: density, unit/√Hz, one-sided.
        drift: in-run bias stability, the flat part of the Allan deviation, unit.
        offset: standard deviation of the constant bias that calibration leaves, unit.
        scale: standard deviation of the relative error of the sensitivity.
    """

    noise: float = 0.0
    drift: float = 0.0
    offset: float = 0.0
    scale: float = 0.0


# Xsens MTi-300, data sheet of Movella, May 2023: 0.01 °/s/√Hz, 10 °/h, 60 µg/√Hz, 15 µg, roll and pitch 0.2° RMS.
# Switched on, its gyros are up to 0.5 °/s off (Xsens, "Bias repeatability of gyroscopes"); a robot that stands still
# measures that, but for the noise meanwhile. The accelerometers' bias cannot be told from a tilt: it is what makes
# roll and pitch wrong at rest. The sheet is silent on the error of the scale; 0.2 % is chosen.
MTI_300_GYRO = DataSheet(
    noise=np.radians(0.01),
    drift=np.radians(10) / 3600,
    offset=np.radians(0.01) / np.sqrt(2 * CALIBRATION_TIME),
    scale=0.002,
)
MTI_300_ACCELEROMETER = DataSheet(
    noise=60e-6 * GRAVITY, drift=15e-6 * GRAVITY, offset=GRAVITY * np.sin(np.radians(0.2)), scale=0.002
)


class InertialTriad:
    """Three axes that measure with noise, a constant bias and one that wanders, and a wrong scale.

    The bias wanders as a Gauss-Markov process of first order, whose Allan deviation has its maximum, 0.62 times the
    standard deviation, after 1.9 ``DRIFT_TIME`` (IEEE Std 952-1997, annex B and C).
    """

    def __init__(self, sheet: DataSheet, rng: np.random.Generator) -> None:
        """``rng`` draws the constant errors now and the noise of every measurement; calibration ends now."""
        self._sheet, self._rng = sheet, rng
        self._scale = 1.0 + sheet.scale * rng.standard_normal(3)
        self._drift = sheet.drift / 0.62 * rng.standard_normal(3)
        self._bias = sheet.offset * rng.standard_normal(3) - self._drift

    def measure(self, true: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        """(3,) mean over the last ``dt`` seconds of what is truly (3,) ``true``, in ``base_link``."""
        memory = np.exp(-dt / DRIFT_TIME)
        renewal, noise = self._rng.standard_normal((2, 3))
        self._drift = memory * self._drift + self._sheet.drift / 0.62 * np.sqrt(1.0 - memory**2) * renewal
        return self._scale * true + self._bias + self._drift + self._sheet.noise / np.sqrt(2 * dt) * noise
