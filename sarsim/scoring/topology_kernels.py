"""Compiled loops: which cells places see along straight lines."""

import numpy as np
from numba import njit

from pipeline.traversability.shortest_paths_kernels import line_is_traversable


@njit(cache=True)
def cells_in_sight(places, target, origin, cell, sight, rules):
    """Which target cells lie within ``sight`` m of each place, with nothing on the line to their centre.

    Args:
        places: (K, 2) float64, m.
        target: (nx, ny) bool, what there is to see.
        origin, cell: of the grid, m.
        sight: m.
        rules: that lines keep to.

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
                    seen[k, a, b] = line_is_traversable(x, y, u, v, origin, cell, rules)
    return seen, corners


@njit(cache=True)
def mark(seen, corner, layer, value):
    """Set the cells of a ``layer`` (nx, ny) that a window (S, S) at a ``corner`` (2,) shows."""
    for a, b in np.argwhere(seen):
        layer[corner[0] + a, corner[1] + b] = value
