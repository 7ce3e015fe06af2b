"""Exact ray traversal (Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", 1987).

Points are in voxels, relative to the corner of the box of marks.
"""

import numpy as np
from numba import njit

FREE, HIT = 1, 2


@njit(cache=True)
def trace_points(points, stops, ends, origin, marks):
    """Mark the voxels of end points as HIT and those that the rays only cross as FREE.

    Args:
        points: (N, 3) float64; only end points must lie inside the box.
        stops: (N, 3) float64, the points up to which the rays free space.
        ends: (N,) bool, which points are end points.
        origin: (3,) float64, the start of all rays.
        marks: (nx, ny, nz) uint8 zeros.
    """
    for n in range(points.shape[0]):
        if ends[n]:
            marks[int(points[n, 0]), int(points[n, 1]), int(points[n, 2])] = HIT
    for n in range(points.shape[0]):
        walk(origin[0], origin[1], origin[2], stops[n, 0], stops[n, 1], stops[n, 2], marks)


@njit(cache=True, nogil=True)
def mark_ends(points, T_grid_camera, size, far, lower, marks):
    """Mark as HIT the voxels of end points (N, 3), m in the grid's frame, up to ``far`` m along the optical axis.

    ``size``: side of a voxel, m; ``lower``: (3,) index of the first voxel of ``marks`` (nx, ny, nz).
    """
    axis, origin = T_grid_camera[:3, 2], T_grid_camera[:3, 3]
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        if axis[0] * (x - origin[0]) + axis[1] * (y - origin[1]) + axis[2] * (z - origin[2]) > far:
            continue
        i = int(np.floor(x / size)) - lower[0]
        j = int(np.floor(y / size)) - lower[1]
        k = int(np.floor(z / size)) - lower[2]
        if 0 <= i < marks.shape[0] and 0 <= j < marks.shape[1] and 0 <= k < marks.shape[2]:
            marks[i, j, k] = HIT


@njit(cache=True)
def walk(x, y, z, x_stop, y_stop, z_stop, marks):
    """Mark as FREE every voxel of (nx, ny, nz) on the line between two points, both included, that is not a HIT."""
    i, i_end, i_step, i_next, i_gap = _along(x, x_stop)
    j, j_end, j_step, j_next, j_gap = _along(y, y_stop)
    k, k_end, k_step, k_next, k_gap = _along(z, z_stop)
    # Counting the faces left to cross, instead of comparing ray parameters, ends each ray exactly in its last voxel.
    for _ in range(abs(i_end - i) + abs(j_end - j) + abs(k_end - k)):
        if marks[i, j, k] != HIT:
            marks[i, j, k] = FREE
        if i_next <= j_next and i_next <= k_next:
            i += i_step
            i_next = i_next + i_gap if i != i_end else np.inf
        elif j_next <= k_next:
            j += j_step
            j_next = j_next + j_gap if j != j_end else np.inf
        else:
            k += k_step
            k_next = k_next + k_gap if k != k_end else np.inf
    if marks[i, j, k] != HIT:
        marks[i, j, k] = FREE


@njit(cache=True)
def _along(begin, end):
    """One axis of a ray: first and last voxel, step, and ray parameter at the next face and between two faces."""
    first, last = int(begin), int(end)
    if first == last:
        return first, last, 0, np.inf, 0.0
    step = 1 if last > first else -1
    face = first + 1 if last > first else first
    return first, last, step, (face - begin) / (end - begin), step / (end - begin)
