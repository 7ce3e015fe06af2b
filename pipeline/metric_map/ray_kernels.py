"""Exact ray traversal (Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", 1987)."""

import numpy as np
from numba import njit

FREE, HIT = 1, 2


@njit(cache=True)
def mark_end_points(points, ends, size, marks):
    """Mark the voxel of each point that is an end point as HIT.

    Args:
        points: (N, 3) float64, in metres from the corner of the box.
        ends: (N,) bool.
        marks: (nx, ny, nz) uint8; every point lies inside.
    """
    for n in range(points.shape[0]):
        if ends[n]:
            i, j, k = int(points[n, 0] / size), int(points[n, 1] / size), int(points[n, 2] / size)
            marks[i, j, k] = HIT


@njit(cache=True)
def mark_rays(points, origin, size, marks):
    """Mark as FREE every voxel that is not a HIT and that the way from the origin to a point leads through.

    Args:
        points: (N, 3) float64, where the rays stop, in metres from the corner of the box.
        origin: (3,) float64, in the same frame.
        marks: (nx, ny, nz) uint8; origin and points lie inside.
    """
    voxel, step, end = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    next_face, per_voxel = np.empty(3), np.empty(3)
    for n in range(points.shape[0]):
        left = 0
        for axis in range(3):
            voxel[axis], end[axis] = int(origin[axis] / size), int(points[n, axis] / size)
            left += abs(end[axis] - voxel[axis])
            reach = points[n, axis] - origin[axis]
            step[axis] = 1 if reach > 0 else -1
            next_face[axis] = per_voxel[axis] = np.inf
            if reach != 0:
                face = voxel[axis] + (1 if reach > 0 else 0)
                next_face[axis] = (face * size - origin[axis]) / reach
                per_voxel[axis] = size / abs(reach)
        # Counting the faces left to cross, instead of comparing parameters, ends every ray in its very voxel.
        while left > 0:
            if marks[voxel[0], voxel[1], voxel[2]] != HIT:
                marks[voxel[0], voxel[1], voxel[2]] = FREE
            axis = int(np.argmin(next_face))
            while voxel[axis] == end[axis]:
                next_face[axis] = np.inf
                axis = int(np.argmin(next_face))
            voxel[axis] += step[axis]
            next_face[axis] += per_voxel[axis]
            left -= 1
        if marks[voxel[0], voxel[1], voxel[2]] != HIT:
            marks[voxel[0], voxel[1], voxel[2]] = FREE
