"""The pixel loop of the colour sensor."""

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from sarsim.sensors.xtion_kernels import NORMAL


@njit(cache=True)
def expose(
    radiance: NDArray[np.float32],
    bits: NDArray[np.uint64],
    gain: float,
    full_well: float,
    read_noise: float,
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 values of a sensor that counts ``full_well`` electrons where the radiance is 1.

    Photon noise is Poisson's, here normal of the same variance; ``read_noise`` is in electrons.
    """
    height, width, channels = radiance.shape
    values = np.empty((height, width, channels), np.uint8)
    unit = np.float32(gain * 255 / full_well)
    floor = np.float32(read_noise * read_noise)
    for v in range(height):
        for u in range(width):
            for c in range(channels):
                electrons = radiance[v, u, c] * np.float32(full_well)
                normal = NORMAL[(bits[v, u] >> uint64(16 * c)) & uint64(0xFFFF)]
                value = unit * (electrons + np.sqrt(electrons + floor) * normal)
                values[v, u, c] = min(max(value + np.float32(0.5), np.float32(0)), np.float32(255))
    return values
