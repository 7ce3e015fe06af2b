"""Compiled filter of isolated returns in a depth image."""

import numpy as np
from numba import njit


@njit(cache=True)
def remove_isolated_returns(depth, reach, tolerance, min_alike):
    """A copy of ``depth`` (H, W), m, with 0 where fewer than ``min_alike`` neighbours have a similar depth.

    Neighbours are at most ``reach`` rows and columns away; similar depths differ by at most the fraction
    ``tolerance``.
    """
    height, width = depth.shape
    result = np.zeros_like(depth)
    for v in range(height):
        for u in range(width):
            z, alike = depth[v, u], -1
            if not 0 < z < np.inf:
                continue
            for j in range(max(v - reach, 0), min(v + reach + 1, height)):
                for i in range(max(u - reach, 0), min(u + reach + 1, width)):
                    alike += abs(depth[j, i] - z) <= tolerance * z
                if alike >= min_alike:
                    result[v, u] = z
                    break
    return result
