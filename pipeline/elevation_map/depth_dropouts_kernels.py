"""Compiled search of a depth image for gaps in the ground."""

import numpy as np
from numba import njit

ROW_STEP = 2
"""Spacing of the rows that are searched for gaps, rows."""


@njit(cache=True)
def interpolate_dropouts(depth, focal, min_grazing, same_surface, min_width, max_width, dropouts):
    """Interpolate the depth of the ground in each narrow gap, and write it to the gap in ``dropouts`` (H, W), m.

    A gap is a run of ``min_width`` to ``max_width`` pixels, in every ``ROW_STEP``-th row, that have no return or a
    nearer one, between two returns whose depths differ by at most a fraction ``same_surface``. ``depth`` is (H, W) m,
    0 where there is no return, and ``focal`` is the vertical focal length, pixels. Surfaces seen at less than
    ``min_grazing``, rad, are ignored, because they may give no returns themselves.
    """
    height, width = depth.shape
    rows = 2 * ROW_STEP  # because the next searched row may be as noisy as the pixel's own
    for v in range(0, height, ROW_STEP):
        left, at = np.float32(0.0), -1
        for u in range(width):
            z = depth[v, u]
            if not z > 0:
                continue
            if at >= 0 and u - at - 1 <= max_width:
                if z < left * (1 - same_surface):
                    continue
                goes_on = z <= left * (1 + same_surface) and u - at - 1 >= min_width
                angle = (
                    min(grazing_angle(depth, v, at, focal, rows), grazing_angle(depth, v, u, focal, rows))
                    if goes_on
                    else 0.0
                )
                if goes_on and angle >= min_grazing:
                    for k in range(at + 1, u):
                        dropouts[v, k] = left + (z - left) * (k - at) / (u - at)
            left, at = z, u


@njit(cache=True)
def grazing_angle(depth, v, u, focal, rows):
    """Angle between a pixel's ray and the surface that it meets, rad; ``depth`` (H, W), m, must not be 0 there.

    The slope is measured between the pixels ``rows`` rows above and below; the angle is 0 if either has no return.
    """
    above, below = max(v - rows, 0), min(v + rows, depth.shape[0] - 1)
    if not (depth[above, u] > 0 and depth[below, u] > 0):
        return 0.0
    rise = abs(depth[above, u] - depth[below, u])
    return np.arctan2(depth[v, u] * (below - above) / focal, rise)
