"""The pixel loop of the colour sensor."""

import numpy as np
from numba import njit, uint64

from sarsim.sensors.xtion_kernels import NORMAL_QUANTILES


@njit(cache=True)
def expose(radiance, bits, gain, full_well, read_noise):
    """(H, W, 3) uint8 pixel values for a radiance.

    Photon noise has a Poisson distribution, which is approximated by a normal distribution of the same variance.

    Args:
        radiance: (H, W, 3) float32 radiance; 1 is white in normal light.
        bits: (H, W) uint64 random numbers.
        gain: amplification of the signal.
        full_well: electrons that the sensor counts at a radiance of 1.
        read_noise: standard deviation of the read noise, electrons.
    """
    height, width, channels = radiance.shape
    values = np.empty((height, width, channels), np.uint8)
    unit = np.float32(gain * 255 / full_well)
    floor = np.float32(read_noise * read_noise)
    for v in range(height):
        for u in range(width):
            for c in range(channels):
                electrons = radiance[v, u, c] * np.float32(full_well)
                normal = NORMAL_QUANTILES[(bits[v, u] >> uint64(16 * c)) & uint64(0xFFFF)]
                value = unit * (electrons + np.sqrt(electrons + floor) * normal)
                values[v, u, c] = min(max(value + np.float32(0.5), np.float32(0)), np.float32(255))
    return values
