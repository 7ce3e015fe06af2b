"""The colour sensor: exposure, gain, and the noise that they cannot hide."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarsim.sensors import colour_kernels
from sarsim.sensors.xtion_kernels import random_bits


@dataclass(frozen=True)
class ColourSensor:
    """A small sensor that exposes no longer than a video frame and then turns its gain up.

    The numbers are those of a 1/4 inch VGA sensor with pixels of 3 µm, the kind that such cameras carry.

    Attributes:
        full_well: electrons of white in normal light.
        read_noise: electrons, standard deviation.
        max_gain: how much the signal is amplified at most.
        target: mean value, of 1, that the gain aims at.
    """

    full_well: float = 4000.0
    read_noise: float = 6.0
    max_gain: float = 8.0
    target: float = 0.3

    def expose(self, radiance: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 picture of (H, W, 3) float32 radiance, where 1 is white in normal light.

        ``rng`` is drawn from once.
        """
        bits = random_bits(rng.integers(1 << 64, dtype=np.uint64), *radiance.shape[:2])
        gain = self.gain(radiance)
        return colour_kernels.expose(radiance, bits, gain, self.full_well, self.read_noise)

    def gain(self, radiance: NDArray[np.float32]) -> float:
        """Amplification that brings the mean to the target, between 1 and the highest."""
        mean = float(radiance.mean(dtype=np.float64))
        return float(np.clip(self.target / max(mean, 1e-9), 1, self.max_gain))
