"""Rays through voxels: exact traversal, which finds every voxel on a line, and sampling, which is faster.

The traversal follows Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", 1987. Coordinates are in
voxels, relative to the lower corner of a box of voxels.
"""

import numpy as np
from numba import njit

FREE, HIT = 1, 2
"""Marks of voxels: crossed by a ray, or containing an end point; 0 means neither."""


@njit(cache=True, nogil=True)
def trace_rays(points, stops, ends, origin, marks):
    """Mark the voxels of end points as HIT, and the voxels that rays only cross as FREE.

    Args:
        points: (N, 3) float64; only end points must lie inside the box.
        stops: (N, 3) float64, the points up to which the rays free space.
        ends: (N,) bool, which points are end points.
        origin: (3,) float64, the start of all rays.
        marks: (nx, ny, nz) uint8, changed in place; voxels that are HIT stay HIT.
    """
    for n in range(points.shape[0]):
        if ends[n]:
            marks[int(points[n, 0]), int(points[n, 1]), int(points[n, 2])] = HIT
        mark_line(origin[0], origin[1], origin[2], stops[n, 0], stops[n, 1], stops[n, 2], marks)


@njit(cache=True)
def mark_line(x, y, z, x_stop, y_stop, z_stop, marks):
    """Mark as FREE the voxels of ``marks`` on a line, including both ends of the line, unless they are HIT."""
    i, i_end, i_step, i_next, i_gap = _ray_axis(x, x_stop)
    j, j_end, j_step, j_next, j_gap = _ray_axis(y, y_stop)
    k, k_end, k_step, k_next, k_gap = _ray_axis(z, z_stop)
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
def _ray_axis(begin, end):
    """One axis of a ray: first and last voxel, step, and ray parameter at the next face and between two faces."""
    first, last = int(begin), int(end)
    if first == last:
        return first, last, 0, np.inf, 0.0
    step = 1 if last > first else -1
    face = first + 1 if last > first else first
    return first, last, step, (face - begin) / (end - begin), step / (end - begin)


@njit(cache=True)
def cast_rays(rays, origins, voxels, reach, step, free, surface):
    """Find the smallest free depth of each ray, and the largest depth at which it meets a surface, over all origins.

    All depths are in voxels along the optical axis.

    Args:
        rays: (N, 3) float64 directions of the rays in the grid's axes, scaled to a depth of 1.
        origins: (M, 3) float64 positions in voxels of the box; each ray is cast from each origin.
        voxels: (nx, ny, nz) int8 log-odds of the voxels in a box of the map; voxels outside the box are unknown.
        reach: maximum depth.
        step: depth between the samples of a ray.
        free: (N,) float64, filled with the depths up to which the rays are free.
        surface: (N,) float64, filled with the depths of the surfaces; infinite if the ray meets no surface from at
            least one origin.
    """
    for n in range(len(rays)):
        free[n], surface[n] = np.inf, 0.0
        for origin in origins:
            depth, is_occupied = _free_depth(rays[n], origin, voxels, reach, step)
            free[n] = min(free[n], depth)
            surface[n] = max(surface[n], depth if is_occupied else np.inf)


@njit(cache=True)
def _free_depth(ray, origin, voxels, reach, step):
    """Depth at which the free part of a ray ends, in voxels, and whether an occupied voxel ends it.

    Unknown voxels right in front of the camera, which are too near to be measured, are skipped.
    """
    depth, last_free = 0.0, 0.0
    while depth < reach:
        i = int(np.floor(origin[0] + ray[0] * depth))
        j = int(np.floor(origin[1] + ray[1] * depth))
        k = int(np.floor(origin[2] + ray[2] * depth))
        inside = 0 <= i < voxels.shape[0] and 0 <= j < voxels.shape[1] and 0 <= k < voxels.shape[2]
        value = voxels[i, j, k] if inside else 0
        if value > 0:
            return depth, True
        if value < 0:
            last_free = depth
        elif last_free > 0:
            return depth, False
        depth += step
    return (reach if last_free > 0 else 0.0), False
