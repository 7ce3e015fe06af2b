"""Compiled ray traversal for the scores, independent of the map's own."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def box_of(points, camera, corner, size):
    """(3,) int64 lowest voxel, and the one after the highest, of a box around points (N, 3) and a camera (3,).

    The box has a margin of one voxel. Voxels have the edge ``size``, m, and are counted from ``corner`` (3,), m.
    """
    low, high = camera.copy(), camera.copy()
    for n in range(len(points)):
        for axis in range(3):
            low[axis] = min(low[axis], points[n, axis])
            high[axis] = max(high[axis], points[n, axis])
    first, last = np.floor((low - corner) / size - 1), np.ceil((high - corner) / size + 1)
    return first.astype(np.int64), last.astype(np.int64)


@njit(cache=True, nogil=True)
def mark_rays(points, camera, corner, size, lower, crossed, ended):
    """Mark the voxels that the straight lines from a camera to points cross, and those where they end.

    Args:
        points: (N, 3) m.
        camera: (3,) m.
        corner: (3,) m, lower corner of the voxel with index 0.
        size: edge of a voxel, m.
        lower: (3,) index of the first voxel of ``crossed``.
        crossed: (nx, ny, nz) bool, voxels before the last one of a line; must contain the camera and the points.
        ended: (nx, ny, nz) bool, last voxels of lines.
    """
    x, y, z = (camera - corner) / size - lower
    for n in range(len(points)):
        # Cross the faces of the grid in the order in which the ray meets them (Siddon's method).
        u = (points[n, 0] - corner[0]) / size - lower[0]
        v = (points[n, 1] - corner[1]) / size - lower[1]
        w = (points[n, 2] - corner[2]) / size - lower[2]
        i, j, k, a, b, c = int(x), int(y), int(z), int(u), int(v), int(w)
        ended[a, b, c] = True
        tx, ty, tz = _meets(i, a, x, u), _meets(j, b, y, v), _meets(k, c, z, w)
        for _ in range(abs(a - i) + abs(b - j) + abs(c - k)):
            crossed[i, j, k] = True
            if tx <= ty and tx <= tz:
                i += 1 if u > x else -1
                tx = _meets(i, a, x, u)
            elif ty <= tz:
                j += 1 if v > y else -1
                ty = _meets(j, b, y, v)
            else:
                k += 1 if w > z else -1
                tz = _meets(k, c, z, w)


@njit(cache=True, inline="always")
def _meets(here, last, start, end):
    """Fraction of the line from ``start`` to ``end`` at which it leaves a voxel along an axis; inf for the last."""
    return ((here + (end > start)) - start) / (end - start) if here != last else np.inf
