"""Compiled search of a depth image for ground that ought to be seen."""

import numpy as np
from numba import njit


@njit(cache=True)
def missing_depth(depth, max_gap, min_gap, tolerance, row_step, missing):
    """Depth of the surface that goes on to the left and to the right of a narrow gap, over the gap's pixels.

    A gap are ``min_gap`` to ``max_gap`` pixels of a row without a return, or with one from something nearer, between
    two returns whose depths differ by no more than the share ``tolerance``. Every ``row_step``-th row is looked at;
    ``missing`` (H, W) is set where the result is not 0.
    """
    height, width = depth.shape
    for v in range(0, height, row_step):
        left, at = np.float32(0.0), -1
        for u in range(width):
            z = depth[v, u]
            if not z > 0:
                continue
            if at >= 0 and u - at - 1 <= max_gap:
                if z < left * (1 - tolerance):
                    continue
                if z <= left * (1 + tolerance) and u - at - 1 >= min_gap:
                    for k in range(at + 1, u):
                        missing[v, k] = left + (z - left) * (k - at) / (u - at)
            left, at = z, u
