"""Compiled loops over the ground that places see."""

import numpy as np
from numba import njit


@njit(cache=True)
def visible_cells(places, target, walls, reach):
    """Which target cells each place sees.

    Rays run to every cell on the rim of a square window around the place, in steps of half a cell, and end at walls.

    Args:
        places: (K, 2) float64, in cells from the grid's corner.
        target: (nx, ny) bool, what there is to see.
        walls: (nx, ny) bool, what hides it.
        reach: cells, how far a place sees.

    Returns:
        (K, 2 reach + 1, 2 reach + 1) bool, and the (K, 2) int64 grid indices of the windows' corners.
    """
    size = 2 * reach + 1
    seen = np.zeros((len(places), size, size), np.bool_)
    corners = np.empty((len(places), 2), np.int64)
    for k in range(len(places)):
        corners[k] = np.floor(places[k, 0]) - reach, np.floor(places[k, 1]) - reach
        for n in range(size):
            for rim_i, rim_j in ((n, 0), (n, size - 1), (0, n), (size - 1, n)):
                _cast(places[k], corners[k], rim_i, rim_j, target, walls, reach, seen[k])
    return seen, corners


@njit(cache=True)
def _cast(place, corner, rim_i, rim_j, target, walls, reach, seen):
    """Mark the target cells on the ray from a place to the rim cell of its window."""
    dx, dy = corner[0] + rim_i + 0.5 - place[0], corner[1] + rim_j + 0.5 - place[1]
    length = np.sqrt(dx * dx + dy * dy)
    for s in range(2 * reach + 2):
        i = int(np.floor(place[0] + dx / length * s / 2))
        j = int(np.floor(place[1] + dy / length * s / 2))
        if not (0 <= i < target.shape[0] and 0 <= j < target.shape[1]) or walls[i, j]:
            return
        x, y = i + 0.5 - place[0], j + 0.5 - place[1]
        if target[i, j] and x * x + y * y <= reach * reach:
            seen[i - corner[0], j - corner[1]] = True


@njit(cache=True)
def count_in(seen, corners, mask):
    """(K,) int64, how many cells of a mask (nx, ny) places see, by their windows (K, S, S)."""
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
def see_all(seen, corners, cells, spare):
    """(K,) bool, whether a place sees all but ``spare`` of the cells (M, 2), by its window (K, S, S)."""
    result = np.empty(len(seen), np.bool_)
    size = seen.shape[1]
    for k in range(len(seen)):
        missed = 0
        for m in range(len(cells)):
            i, j = cells[m, 0] - corners[k, 0], cells[m, 1] - corners[k, 1]
            missed += not (0 <= i < size and 0 <= j < size and seen[k, i, j])
        result[k] = missed <= spare
    return result
