"""Weighing a scan against the map, and reading the map."""

import numpy as np
from numba import njit

HIT = 2


@njit(cache=True)
def fold(marks, log_odds, hit, miss, least, greatest):
    """Add a scan's marks to the log-odds of the same voxels, within ``least``..``greatest``.

    Args:
        marks: (nx, ny, nz) uint8, 0 unseen, 1 free, 2 hit.
        log_odds: (nx, ny, nz) int8, changed in place.
        hit, miss: positive int, what an end point adds and a crossing takes.
    """
    gain = np.array((0, -miss, hit), np.int16)
    nx, ny, nz = marks.shape
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                mark = marks[i, j, k]
                value = np.int16(log_odds[i, j, k]) + gain[mark]
                value = min(max(value, least), greatest)
                log_odds[i, j, k] = value if mark != 0 else log_odds[i, j, k]
