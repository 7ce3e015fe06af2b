"""Compiled functions: the cell that contains a point, and loops over sorted sets of cells."""

import numpy as np
from numba import njit

from pipeline.geometry.moving_kernels import moved
from pipeline.geometry.voxel_hash_kernels import unpacked, voxels_of


@njit(cache=True)
def cell_at(x, y, origin, cell):
    """The cell (i, j) that contains a point, m, on a grid with cells of ``cell`` m and its corner at ``origin``."""
    return int(np.floor((x - origin[0]) / cell)), int(np.floor((y - origin[1]) / cell))


@njit(cache=True, nogil=True)
def placed_cells(T, points, edge):
    """(K, 3) int32 sorted cells, centred at multiples of ``edge``, that contain points (N, 3), m, moved by ``T``."""
    return unpacked(np.sort(voxels_of(moved(T, points) + np.float32(edge / 2), np.float32(1 / edge))[1]))


@njit(cache=True)
def bounds(cells):
    """(2, 3) int64 minimum and maximum index along each axis of at least one cell (K, 3)."""
    result = np.empty((2, 3), np.int64)
    for axis in range(3):
        result[:, axis] = cells[0, axis]
    for n in range(len(cells)):
        for axis in range(3):
            result[0, axis] = min(result[0, axis], cells[n, axis])
            result[1, axis] = max(result[1, axis], cells[n, axis])
    return result


@njit(cache=True)
def united(a, b):
    """(M, 3) int32 sorted union of two sorted sets of cells, (K, 3) and (L, 3)."""
    result, i, j, count = np.empty((len(a) + len(b), 3), np.int32), 0, 0, 0
    while i < len(a) or j < len(b):
        order = -1 if j == len(b) else 1 if i == len(a) else compared(a[i], b[j, 0], b[j, 1], b[j, 2])
        result[count] = a[i] if order <= 0 else b[j]
        i, j, count = i + (order <= 0), j + (order >= 0), count + 1
    return result[:count]


@njit(cache=True)
def count_near(cells, others, reach, enough):
    """Number of cells (K, 3) with any of the sorted ``others`` (L, 3) within ``reach`` cells along every axis.

    Counting stops at ``enough``.
    """
    count, n = 0, 0
    while n < len(cells) and count < enough:
        # The first of the sorted cells has the lowest first index, the last one the highest.
        if others[0, 0] - reach <= cells[n, 0] <= others[-1, 0] + reach:
            count += has_near(cells[n], others, reach)
        n += 1
    return count


@njit(cache=True)
def has_near(cell, others, reach):
    """Whether any of the sorted ``others`` (L, 3) is within ``reach`` cells of a cell (3,) along every axis."""
    for i in range(cell[0] - reach, cell[0] + reach + 1):
        for j in range(cell[1] - reach, cell[1] + reach + 1):
            first, end = 0, len(others)
            while first < end:
                middle = (first + end) // 2
                if compared(others[middle], i, j, cell[2] - reach) < 0:
                    first = middle + 1
                else:
                    end = middle
            if first < len(others) and compared(others[first], i, j, cell[2] + reach) <= 0:
                return True
    return False


@njit(cache=True, inline="always")
def compared(cell, i, j, k):
    """-1, 0 or 1 if a cell (3,) sorts before, equal to or after the indices (i, j, k)."""
    for mine, other in ((cell[0], i), (cell[1], j), (cell[2], k)):
        if mine != other:
            return -1 if mine < other else 1
    return 0
