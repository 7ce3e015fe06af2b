"""Compiled search of a depth image for gaps in the ground."""

import numpy as np
from numba import njit

_ROWS = 4
"""Rows above and below a pixel by which its surface's slope is measured."""


@njit(cache=True)
def dropout_depth(depth, focal, max_gap, min_gap, tolerance, min_grazing, row_step, dropouts):
    """Depth of the surface that goes on to the left and to the right of a narrow gap, over the gap's pixels.

    A gap is ``min_gap`` to ``max_gap`` pixels of a row without a return, or with one from something nearer, between
    two returns whose depths differ by no more than the share ``tolerance``. Nothing is a gap on a surface that is
    itself seen at less than ``min_grazing`` rad. Every ``row_step``-th row is searched; ``dropouts`` (H, W) is set
    where the result is not 0. ``focal`` is the vertical focal length in pixels.
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
                goes_on = z <= left * (1 + tolerance) and u - at - 1 >= min_gap
                angle = min(grazing(depth, v, at, focal), grazing(depth, v, u, focal)) if goes_on else 0.0
                if goes_on and angle >= min_grazing:
                    for k in range(at + 1, u):
                        dropouts[v, k] = left + (z - left) * (k - at) / (u - at)
            left, at = z, u


@njit(cache=True)
def grazing(depth, v, u, focal):
    """Angle between the ray of a pixel with a return and the surface that it meets, in rad, by the rows around it."""
    above, below = max(v - _ROWS, 0), min(v + _ROWS, depth.shape[0] - 1)
    if not (depth[above, u] > 0 and depth[below, u] > 0):
        return 0.0
    rise = abs(depth[above, u] - depth[below, u])
    return np.arctan2(depth[v, u] * (below - above) / focal, rise)
