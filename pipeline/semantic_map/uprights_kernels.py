"""Compiled loops over the cells of a grid seen from above: the directions and lengths of upright surfaces."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def directions(counts, reach):
    """(nx, ny) float32 angle of the principal axis of the points around every cell, rad; NaN in an empty cell.

    Args:
        counts: (nx, ny) int32 number of points in every cell.
        reach: distance along each axis up to which points are included, cells.
    """
    result = np.full(counts.shape, np.nan, np.float32)
    for i, j in np.argwhere(counts > 0):
        n = x = y = xx = xy = yy = 0.0
        for k in range(max(i - reach, 0), min(i + reach + 1, counts.shape[0])):
            for m in range(max(j - reach, 0), min(j + reach + 1, counts.shape[1])):
                w, a, b = counts[k, m], k - i, m - j
                n, x, y = n + w, x + w * a, y + w * b
                xx, xy, yy = xx + w * a * a, xy + w * a * b, yy + w * b * b
        # The axis of greatest variance of a 2 × 2 covariance matrix.
        result[i, j] = np.arctan2(2 * (xy - x * y / n), (xx - x * x / n) - (yy - y * y / n)) / 2
    return result


@njit(cache=True, nogil=True)
def is_on_long_run(direction, length, gap, tolerance):
    """(nx, ny) bool: the cells in a run of ``length`` or more cells that share one direction and lie along it.

    Args:
        direction: (nx, ny) rad; NaN in an empty cell.
        length: minimum length of a run from its first to its last cell, cells.
        gap: maximum number of successive cells that may be missing in a run.
        tolerance: maximum difference between the directions of cells in a run, rad.
    """
    result = np.zeros(direction.shape, np.bool_)
    for i, j in np.argwhere(~np.isnan(direction)):
        angle = direction[i, j]
        ahead = run_length(direction, i, j, angle, length, gap, tolerance)
        behind = run_length(direction, i, j, angle + np.pi, length, gap, tolerance)
        result[i, j] = ahead + behind + 1 >= length
    return result


@njit(cache=True, nogil=True)
def run_length(direction, i, j, angle, length, gap, tolerance):
    """Number of cells from (i, j) along ``angle``, rad, to the last cell of a run.

    For the other arguments, see :func:`is_on_long_run`.
    """
    last, step = 0, 1
    while step - last <= gap + 1 and last < length:
        k, m = i + round(step * np.cos(angle)), j + round(step * np.sin(angle))
        is_inside = 0 <= k < direction.shape[0] and 0 <= m < direction.shape[1]
        # Directions are axes: reversing one does not change the magnitude of the sine of the angle between them.
        if is_inside and abs(np.sin(direction[k, m] - angle)) <= tolerance:
            last = step
        step += 1
    return last
