"""Compiled loops over the cells of a plan: which way what stands in them runs, and how far."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def directions(counts, reach):
    """(nx, ny) float32 angle in rad of the principal axis of the points around every cell; NaN in an empty cell.

    Args:
        counts: (nx, ny) int32 points in every cell.
        reach: cells, how far from a cell along each axis points count.
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
def on_long_runs(direction, length, gap, tolerance):
    """(nx, ny) bool, the cells from which others of their own direction follow along it, ``length`` cells in all.

    Args:
        direction: (nx, ny) rad; NaN in an empty cell.
        length: cells from the first to the last of a run.
        gap: most cells in a row that a run may lack.
        tolerance: rad between the directions of cells of one run.
    """
    result = np.zeros(direction.shape, np.bool_)
    for i, j in np.argwhere(~np.isnan(direction)):
        angle = direction[i, j]
        ahead = farthest(direction, i, j, angle, length, gap, tolerance)
        behind = farthest(direction, i, j, angle + np.pi, length, gap, tolerance)
        result[i, j] = ahead + behind + 1 >= length
    return result


@njit(cache=True, nogil=True)
def farthest(direction, i, j, angle, length, gap, tolerance):
    """Cells from (i, j), at an ``angle``, to the last of a run; the rest as in :func:`on_long_runs`."""
    last, step = 0, 1
    while step - last <= gap + 1 and last < length:
        k, m = i + round(step * np.cos(angle)), j + round(step * np.sin(angle))
        is_inside = 0 <= k < direction.shape[0] and 0 <= m < direction.shape[1]
        # The sine of the angle between lines has the same size when one of them is turned around.
        if is_inside and abs(np.sin(direction[k, m] - angle)) <= tolerance:
            last = step
        step += 1
    return last
