"""A hash table of cubic cells with open addressing and linear probing.

A key packs the three indices of a cell; keys sort as the indices do. A table has 2ⁿ slots; empty ones hold ``EMPTY``.
"""

import numpy as np
from numba import int64, njit, uint64

BITS = 21
"""Bits of a key for each of a cell's three indices."""
HALF = 1 << (BITS - 1)
"""Bound of a cell's indices: cells farther from the origin, along any axis, have no key."""
EMPTY = -1
NO_INDEX = -HALF
"""Index of a point without a cell."""
FIBONACCI = 0x9E3779B97F4A7C15
"""2⁶⁴ over the golden ratio: multiplicative hashing, Knuth, The Art of Computer Programming 6.4."""


@njit(cache=True)
def cells_of(points, per_metre):
    """(N,) int32 cell of every point (N, 3), EMPTY for points without a key, and the (M,) keys of the cells."""
    bits, cells, of_point = 10, 0, np.empty(len(points), np.int32)
    cell_keys, last_key, cell = np.empty(1 << bits, np.int64), int64(EMPTY), int64(EMPTY)
    keys, indices = np.full(2 << bits, EMPTY, np.int64), np.empty(2 << bits, np.int32)
    for n in range(len(points)):
        key = cell_key(points[n], per_metre)
        if key != last_key and key != EMPTY:
            slot = find_slot(keys, 63 - bits, key)
            if keys[slot] == EMPTY:
                keys[slot], indices[slot], cell_keys[cells] = key, cells, key
                cells += 1
            last_key, cell = key, int64(indices[slot])
        of_point[n] = cell if key != EMPTY else EMPTY
        if cells == 1 << bits:
            bits += 1
            keys, indices = np.full(2 << bits, EMPTY, np.int64), np.empty(2 << bits, np.int32)
            cell_keys = np.append(cell_keys, np.empty(cells, np.int64))
            insert_all(keys, indices, 63 - bits, cell_keys[:cells])
    return of_point, cell_keys[:cells]


@njit(cache=True)
def insert_all(keys, indices, shift, cell_keys):
    """Fill an empty table, (size,) ``keys`` and ``indices``, which maps ``cell_keys[i]`` (N,) to ``i``."""
    for i in range(len(cell_keys)):
        slot = find_slot(keys, shift, cell_keys[i])
        keys[slot], indices[slot] = cell_keys[i], i


@njit(cache=True, inline="always")
def cell_key(point, per_metre):
    """The key of the cell that contains the point (3,), or EMPTY."""
    i, j, k = indices_of(point, per_metre)
    return packed(i, j, k) if i != NO_INDEX else int64(EMPTY)


@njit(cache=True, inline="always")
def indices_of(point, per_metre):
    """The indices of the cell that contains the point (3,); the first is NO_INDEX if it is NaN or too far away."""
    i, j, k = np.floor(point[0] * per_metre), np.floor(point[1] * per_metre), np.floor(point[2] * per_metre)
    if not (abs(i) < HALF and abs(j) < HALF and abs(k) < HALF):
        return int64(NO_INDEX), int64(0), int64(0)
    return int64(i), int64(j), int64(k)


@njit(cache=True, inline="always")
def packed(i, j, k):
    """The key of the indices (i, j, k), int64."""
    return ((i + HALF) << BITS | (j + HALF)) << BITS | (k + HALF)


@njit(cache=True, inline="always")
def find_slot(keys, shift, key):
    """The slot of the table (size,) that holds the key, or the empty slot into which it belongs."""
    slot = int64((uint64(key) * uint64(FIBONACCI)) >> uint64(shift))
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = int64((slot + 1) & int64(keys.size - 1))
    return slot


@njit(cache=True, nogil=True)
def moved(T, points):
    """(N, 3) float32 points, m, moved by the 4×4 float64 transform ``T``."""
    result = np.empty(points.shape, np.float32)
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        for row in range(3):
            result[n, row] = T[row, 0] * x + T[row, 1] * y + T[row, 2] * z + T[row, 3]
    return result


@njit(cache=True, nogil=True)
def placed_cells(T, points, edge):
    """(K, 3) int32 sorted cells, centred at multiples of the ``edge``, m, of points (N, 3) moved by a 4×4 ``T``."""
    keys = np.sort(cells_of(moved(T, points) + np.float32(edge / 2), np.float32(1 / edge))[1])
    result, mask = np.empty((len(keys), 3), np.int32), (1 << BITS) - 1
    for n in range(len(keys)):
        for axis in range(3):
            result[n, axis] = (keys[n] >> (2 - axis) * BITS & mask) - HALF
    return result


@njit(cache=True)
def bounds(cells):
    """(2, 3) int64 least and greatest index along each axis of the cells (K, 3), K at least 1."""
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
    """How many of the cells (K, 3) have any of the sorted cells (L, 3) up to ``reach`` away along every axis.

    The count ends at ``enough``.
    """
    count, n = 0, 0
    while n < len(cells) and count < enough:
        # Sorted cells begin with the least first index and end with the greatest.
        if others[0, 0] - reach <= cells[n, 0] <= others[-1, 0] + reach:
            count += has_near(cells[n], others, reach)
        n += 1
    return count


@njit(cache=True)
def has_near(cell, others, reach):
    """Whether any of the sorted cells (L, 3) is up to ``reach`` away from a cell (3,) along every axis."""
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
    """-1, 0 or 1: whether a cell (3,) sorts before, as or after the indices (i, j, k)."""
    for mine, other in ((cell[0], i), (cell[1], j), (cell[2], k)):
        if mine != other:
            return -1 if mine < other else 1
    return 0
