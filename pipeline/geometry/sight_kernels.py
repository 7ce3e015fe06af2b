"""Compiled loops: lines of sight on a grid.

A line to each cell's centre is exact. Rays to the rim of a square are many times faster, because they share their
first cells, and their results differ only at corners.
"""

import numpy as np
from numba import njit

from pipeline.geometry.cells_kernels import cell_at


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
def cells_in_sight(places, target, origin, cell, sight, free):
    """Find the target cells that lie within ``sight`` m of each place and have a free line to their centre.

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
        i, j = cell_at(x, y, origin, cell)
        corners[k] = i - reach, j - reach
        for a in range(max(0, -corners[k, 0]), min(size, target.shape[0] - corners[k, 0])):
            for b in range(max(0, -corners[k, 1]), min(size, target.shape[1] - corners[k, 1])):
                i, j = corners[k, 0] + a, corners[k, 1] + b
                u, v = origin[0] + (i + 0.5) * cell, origin[1] + (j + 0.5) * cell
                if target[i, j] and np.hypot(u - x, v - y) <= sight:
                    seen[k, a, b] = line_is_free(x, y, u, v, origin, cell, free)
    return seen, corners


@njit(cache=True)
def visible_cells(cells, target, walls, rays, reach):
    """Find the target cells that are seen from each of several cells, along rays that end at walls.

    Args:
        cells: (K, 2) int64 grid indices of the cells from which to look.
        target: (nx, ny) bool, cells to be seen.
        walls: (nx, ny) bool, cells that hide the cells behind them.
        rays: tree of the rays for this ``reach``, see :func:`pipeline.geometry.sight.ray_tree`.
        reach: maximum distance of sight, cells.

    Returns:
        (K, 2 reach + 1, 2 reach + 1) bool, windows around the cells.
    """
    size = 2 * reach + 1
    seen = np.zeros((len(cells), size, size), np.bool_)
    for k in range(len(cells)):
        n = 0
        while n < len(rays):
            i, j = cells[k, 0] + rays[n, 0], cells[k, 1] + rays[n, 1]
            if not (0 <= i < target.shape[0] and 0 <= j < target.shape[1]) or walls[i, j]:
                n = rays[n, 2]
                continue
            if target[i, j]:
                seen[k, rays[n, 0] + reach, rays[n, 1] + reach] = True
            n += 1
    return seen
