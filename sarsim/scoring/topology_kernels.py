"""Compiled loops: lines of sight and shortest paths on a grid."""

import heapq

import numpy as np
from numba import njit

from pipeline.elevation_map.elevation_kernels import cell_at


@njit(cache=True)
def line_is_free(ax, ay, bx, by, origin, cell, free):
    """Whether a straight line between two points, m, lies only on cells of a mask ``free`` (nx, ny)."""
    steps = int(np.ceil(2 * np.hypot(bx - ax, by - ay) / cell)) + 1
    for s in range(steps + 1):
        i, j = cell_at(ax + (bx - ax) * s / steps, ay + (by - ay) * s / steps, origin, cell)
        if not (0 <= i < free.shape[0] and 0 <= j < free.shape[1] and free[i, j]):
            return False
    return True


@njit(cache=True)
def way_length(i, j, goal_i, goal_j, free):
    """Length in cells of the shortest 8-connected path between two cells of a mask ``free`` (nx, ny); inf if none."""
    length = np.full(free.shape, np.inf)
    length[i, j] = 0.0
    heap = [(0.0, i, j)]
    while len(heap) > 0:
        so_far, i, j = heapq.heappop(heap)
        if i == goal_i and j == goal_j:
            return so_far
        if so_far > length[i, j]:
            continue
        for a in range(max(i - 1, 0), min(i + 2, free.shape[0])):
            for b in range(max(j - 1, 0), min(j + 2, free.shape[1])):
                new = so_far + np.hypot(a - i, b - j)
                if free[a, b] and new < length[a, b]:
                    length[a, b] = new
                    heapq.heappush(heap, (new, a, b))
    return np.inf


@njit(cache=True)
def cells_in_sight(places, target, origin, cell, sight, free):
    """Which target cells lie within ``sight`` m of each place, with a free line to their centre.

    Args:
        places: (K, 2) float64, m.
        target: (nx, ny) bool, the cells to see.
        origin, cell: (2,) lower corner of the grid, and edge length of a cell, m.
        sight: maximum distance, m.
        free: (nx, ny) bool, the cells that lines may cross.

    Returns:
        (K, S, S) bool, a window around each place, and the (K, 2) int64 grid indices of the windows' corners.
    """
    reach = int(np.ceil(sight / cell))
    size = 2 * reach + 1
    seen = np.zeros((len(places), size, size), np.bool_)
    corners = np.empty((len(places), 2), np.int64)
    for k in range(len(places)):
        x, y = places[k]
        corners[k] = np.floor((x - origin[0]) / cell) - reach, np.floor((y - origin[1]) / cell) - reach
        for a in range(max(0, -corners[k, 0]), min(size, target.shape[0] - corners[k, 0])):
            for b in range(max(0, -corners[k, 1]), min(size, target.shape[1] - corners[k, 1])):
                i, j = corners[k, 0] + a, corners[k, 1] + b
                u, v = origin[0] + (i + 0.5) * cell, origin[1] + (j + 0.5) * cell
                if target[i, j] and np.hypot(u - x, v - y) <= sight:
                    seen[k, a, b] = line_is_free(x, y, u, v, origin, cell, free)
    return seen, corners
