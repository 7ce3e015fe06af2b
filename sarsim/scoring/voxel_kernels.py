"""Compiled ray traversal for the scores, independent of the map's own."""

import numpy as np
from numba import njit


@njit(cache=True)
def mark_crossed(points, origin, crossed):
    """Mark every voxel on the straight line from ``origin`` to each of ``points``, except its last one.

    Args:
        points: (N, 3) float64, in voxels from the corner of ``crossed``.
        origin: (3,) float64, in the same units.
        crossed: (nx, ny, nz) bool; origin and points lie inside.
    """
    for n in range(len(points)):
        # Cross the faces of the grid in the order in which the ray meets them (Siddon's method).
        i, j, k = int(origin[0]), int(origin[1]), int(origin[2])
        a, b, c = int(points[n, 0]), int(points[n, 1]), int(points[n, 2])
        dx, dy, dz = points[n, 0] - origin[0], points[n, 1] - origin[1], points[n, 2] - origin[2]
        for _ in range(abs(a - i) + abs(b - j) + abs(c - k)):
            crossed[i, j, k] = True
            tx = ((i + (dx > 0)) - origin[0]) / dx if i != a else np.inf
            ty = ((j + (dy > 0)) - origin[1]) / dy if j != b else np.inf
            tz = ((k + (dz > 0)) - origin[2]) / dz if k != c else np.inf
            if tx <= ty and tx <= tz:
                i += 1 if dx > 0 else -1
            elif ty <= tz:
                j += 1 if dy > 0 else -1
            else:
                k += 1 if dz > 0 else -1
