"""The compiled loop that thins a mask."""

import numpy as np
from numba import njit


@njit(cache=True)
def edge_cells(thin, ring, first, second):
    """(nx, ny) bool, the cells that one of the two passes of Zhang-Suen thinning removes from a mask (nx, ny).

    Args:
        thin: the mask.
        ring: (8, 2) int64, steps to the neighbours, in circular order.
        first, second: (3,) int64 indices in ``ring`` of neighbours, at least one of which must be outside.
    """
    goes = np.zeros(thin.shape, np.bool_)
    around = np.empty(8, np.bool_)
    for i in range(thin.shape[0]):
        for j in range(thin.shape[1]):
            if not thin[i, j]:
                continue
            for k in range(8):
                a, b = i + ring[k, 0], j + ring[k, 1]
                around[k] = 0 <= a < thin.shape[0] and 0 <= b < thin.shape[1] and thin[a, b]
            count, crossings = 0, 0
            for k in range(8):
                count += around[k]
                crossings += not around[k] and around[(k + 1) % 8]
            goes[i, j] = (
                2 <= count <= 6
                and crossings == 1
                and not (around[first[0]] and around[first[1]] and around[first[2]])
                and not (around[second[0]] and around[second[1]] and around[second[2]])
            )
    return goes
