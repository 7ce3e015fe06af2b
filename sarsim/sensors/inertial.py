"""The errors of three gyros or three accelerometers, from the figures of a data sheet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GRAVITY = 9.81  # m/s²
DRIFT_TIME = 100.0
"""s, correlation time of a bias. Data sheets omit it; 100 s is where the Allan deviation of MEMS sensors is flat."""
CALIBRATION_TIME = 10.0
"""s, time for which the robot stands still before it first drives, to measure the gyros' bias."""


@dataclass(frozen=True)
class InertialErrorModel:
    """Errors of each axis; the unit is rad/s or m/s².

    Attributes:
        noise_density: one-sided noise density, unit/√Hz.
        bias_stability: in-run bias stability, the flat part of the Allan deviation, unit.
        bias_sigma: standard deviation of the constant bias that calibration leaves, unit.
        scale_sigma: standard deviation of the relative error of the sensitivity.
    """

    noise_density: float = 0.0
    bias_stability: float = 0.0
    bias_sigma: float = 0.0
    scale_sigma: float = 0.0


# Xsens MTi-300, data sheet of Movella, May 2023: 0.01 °/s/√Hz, 10 °/h, 60 µg/√Hz, 15 µg, roll and pitch 0.2° RMS.
# At power-on, its gyros have a bias of up to 0.5 °/s (Xsens, "Bias repeatability of gyroscopes"), which a robot that
# stands still measures, except for the noise. The accelerometers' bias cannot be distinguished from a tilt, and so
# causes the error of roll and pitch at rest. The data sheet does not give the error of the scale; 0.2% is chosen.
MTI_300_GYRO = InertialErrorModel(
    noise_density=np.radians(0.01),
    bias_stability=np.radians(10) / 3600,
    bias_sigma=np.radians(0.01) / np.sqrt(2 * CALIBRATION_TIME),
    scale_sigma=0.002,
)
MTI_300_ACCELEROMETER = InertialErrorModel(
    noise_density=60e-6 * GRAVITY,
    bias_stability=15e-6 * GRAVITY,
    bias_sigma=GRAVITY * np.sin(np.radians(0.2)),
    scale_sigma=0.002,
)


class InertialTriad:
    """Three axes that measure with noise, a constant and a drifting bias, and a scale error.

    The drifting bias is a Gauss-Markov process of first order, whose Allan deviation has its maximum, 0.62 times the
    standard deviation, after 1.9 ``DRIFT_TIME`` (IEEE Std 952-1997, annexes B and C).
    """

    def __init__(self, errors: InertialErrorModel, rng: np.random.Generator) -> None:
        """Start at the end of calibration; ``rng`` draws the constant errors and the noise of every measurement."""
        self._errors, self._rng = errors, rng
        self._scale = 1.0 + errors.scale_sigma * rng.standard_normal(3)
        self._drift = errors.bias_stability / 0.62 * rng.standard_normal(3)
        self._bias = errors.bias_sigma * rng.standard_normal(3) - self._drift

    def measure(self, true: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        """(3,) measured mean over the last ``dt`` s, given the ``true`` mean (3,), both in ``base_link``."""
        memory = np.exp(-dt / DRIFT_TIME)
        renewal, noise = self._rng.standard_normal((2, 3))
        self._drift = memory * self._drift + self._errors.bias_stability / 0.62 * np.sqrt(1.0 - memory**2) * renewal
        return self._scale * true + self._bias + self._drift + self._errors.noise_density / np.sqrt(2 * dt) * noise
