"""Compiled loops over the lines between nodes."""

import numpy as np
from numba import njit


@njit(cache=True)
def metres_on(starts, ends, origin, cell, mask):
    """(N,) metres of each line between points (N, 2) that lie over a mask (nx, ny)."""
    result = np.zeros(len(starts))
    for n in range(len(starts)):
        dx, dy = ends[n, 0] - starts[n, 0], ends[n, 1] - starts[n, 1]
        length = np.sqrt(dx * dx + dy * dy)
        steps = int(np.ceil(2 * length / cell)) + 1
        for s in range(steps):
            i = int(np.floor((starts[n, 0] + dx * (s + 0.5) / steps - origin[0]) / cell))
            j = int(np.floor((starts[n, 1] + dy * (s + 0.5) / steps - origin[1]) / cell))
            if 0 <= i < mask.shape[0] and 0 <= j < mask.shape[1] and mask[i, j]:
                result[n] += length / steps
    return result
