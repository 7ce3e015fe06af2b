"""Compiled loops over the cells that are seen from several positions."""

import numpy as np
from numba import njit


@njit(cache=True)
def count_in(seen, corners, mask):
    """(K,) int64, number of cells of a mask (nx, ny) seen from each of K positions.

    ``seen`` (K, S, S): which cells of each position's window are seen. ``corners`` (K, 2): indices of the windows'
    first cells in the mask.
    """
    counts = np.zeros(len(seen), np.int64)
    size = seen.shape[1]
    for k in range(len(seen)):
        low_i, low_j = max(0, -corners[k, 0]), max(0, -corners[k, 1])
        high_i = min(size, mask.shape[0] - corners[k, 0])
        high_j = min(size, mask.shape[1] - corners[k, 1])
        for i in range(low_i, high_i):
            for j in range(low_j, high_j):
                counts[k] += seen[k, i, j] and mask[corners[k, 0] + i, corners[k, 1] + j]
    return counts


@njit(cache=True)
def only_seen_by(seen, corners, counts):
    """(K, 2) int64, the cells that only M nodes see.

    ``seen`` (M, S, S) and ``corners`` (M, 2): the nodes' windows, as for :func:`count_in`. ``counts`` (nx, ny):
    number of nodes that see each cell, these M nodes included.
    """
    size, number = seen.shape[1], 0
    cells = np.empty((seen.sum(), 2), np.int64)
    for m in range(len(seen)):
        for i in range(size):
            for j in range(size):
                a, b = corners[m, 0] + i, corners[m, 1] + j
                if not seen[m, i, j] or not (0 <= a < counts.shape[0] and 0 <= b < counts.shape[1]):
                    continue
                left, is_first = counts[a, b] - 1, True
                for n in range(len(seen)):
                    c, d = a - corners[n, 0], b - corners[n, 1]
                    if n != m and 0 <= c < size and 0 <= d < size and seen[n, c, d]:
                        left -= 1
                        is_first &= n > m
                if left == 0 and is_first:
                    cells[number, 0], cells[number, 1] = a, b
                    number += 1
    return cells[:number]


@njit(cache=True)
def see_all(seen, corners, cells, spare):
    """(K,) bool, whether all but at most ``spare`` of the cells (M, 2) are seen from each of K positions.

    ``seen`` and ``corners``: see :func:`count_in`.
    """
    result = np.empty(len(seen), np.bool_)
    size = seen.shape[1]
    for k in range(len(seen)):
        missed = 0
        for m in range(len(cells)):
            i, j = cells[m, 0] - corners[k, 0], cells[m, 1] - corners[k, 1]
            missed += not (0 <= i < size and 0 <= j < size and seen[k, i, j])
        result[k] = missed <= spare
    return result
