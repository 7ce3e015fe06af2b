"""Compiled ray traversal for the scores, independent of the map's own."""

import numpy as np
from numba import njit


@njit(cache=True)
def mark_rays(points, origin, crossed, ended):
    """Mark the voxels that the straight lines from ``origin`` to each of ``points`` cross, and those where they end.

    Args:
        points: (N, 3) float64, in voxels from the corner of ``crossed``.
        origin: (3,) float64, in the same units.
        crossed: (nx, ny, nz) bool, voxels before the last one of a line; origin and points lie inside.
        ended: (nx, ny, nz) bool, last voxels of lines.
    """
    for n in range(len(points)):
        # Cross the faces of the grid in the order in which the ray meets them (Siddon's method).
        i, j, k = int(origin[0]), int(origin[1]), int(origin[2])
        a, b, c = int(points[n, 0]), int(points[n, 1]), int(points[n, 2])
        ended[a, b, c] = True
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
