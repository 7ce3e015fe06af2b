"""Compiled search of a depth image for gaps in the ground."""

import numpy as np
from numba import njit

MIN_GAP, MAX_GAP = 3, 60
"""Pixels, width of a gap: the sensor frays edges by less, and wider gaps leave unknown ground behind them."""
TOLERANCE = np.float32(0.06)
"""Share by which the depths to the left and to the right may differ."""
ROW_STEP = 2
"""Rows from one searched row to the next."""
_ROWS = 4
"""Rows above and below a pixel by which its surface's slope is measured."""


@njit(cache=True)
def dropout_depth(depth, focal, least_grazing, dropouts):
    """Write the depth of the surface on both sides of each narrow gap to the gap's pixels in ``dropouts`` (H, W), m.

    A gap is a run of pixels in a row without a return, or with a nearer one, between two returns of nearly equal
    depth. ``depth`` is (H, W) m, 0 without a return, and ``focal`` the vertical focal length in pixels.
    Ground that is seen at a smaller angle than ``least_grazing``, rad, may itself give no return.
    """
    height, width = depth.shape
    for v in range(0, height, ROW_STEP):
        left, at = np.float32(0.0), -1
        for u in range(width):
            z = depth[v, u]
            if not z > 0:
                continue
            if at >= 0 and u - at - 1 <= MAX_GAP:
                if z < left * (1 - TOLERANCE):
                    continue
                goes_on = z <= left * (1 + TOLERANCE) and u - at - 1 >= MIN_GAP
                angle = min(grazing(depth, v, at, focal), grazing(depth, v, u, focal)) if goes_on else 0.0
                if goes_on and angle >= least_grazing:
                    for k in range(at + 1, u):
                        dropouts[v, k] = left + (z - left) * (k - at) / (u - at)
            left, at = z, u


@njit(cache=True)
def grazing(depth, v, u, focal):
    """Angle in rad between a pixel's ray and the surface that it meets, by ``depth`` (H, W), which is not 0 there."""
    above, below = max(v - _ROWS, 0), min(v + _ROWS, depth.shape[0] - 1)
    if not (depth[above, u] > 0 and depth[below, u] > 0):
        return 0.0
    rise = abs(depth[above, u] - depth[below, u])
    return np.arctan2(depth[v, u] * (below - above) / focal, rise)
