"""The colour sensor: exposure, gain, and noise.

A small sensor exposes for at most one video frame; in less light it raises its gain. The numbers are those of a
1/4 inch VGA sensor with pixels of 3 µm, the kind that such cameras have.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from sarsim.sensors import colour_kernels
from sarsim.sensors.xtion_kernels import random_bits

FULL_WELL = 4000.0  # electrons for white in normal light
READ_NOISE = 6.0  # electrons, standard deviation
MAX_GAIN = 8.0  # Largest amplification of the signal
TARGET = 0.3  # Mean value, in 0..1, that the gain aims at


def expose(radiance: NDArray[np.float32], rng: np.random.Generator) -> Rgb:
    """Image of (H, W, 3) float32 radiance, where 1 is white in normal light.

    ``rng`` is drawn from once.
    """
    bits = random_bits(rng.integers(1 << 64, dtype=np.uint64), *radiance.shape[:2])
    return colour_kernels.expose(radiance, bits, exposure_gain(radiance), FULL_WELL, READ_NOISE)


def exposure_gain(radiance: NDArray[np.float32]) -> float:
    """Amplification that brings the mean of (H, W, 3) float32 radiance to the target, from 1 to ``MAX_GAIN``."""
    mean = float(radiance.mean(dtype=np.float64))
    return float(np.clip(TARGET / max(mean, 1e-9), 1, MAX_GAIN))
