"""Rays through voxels of the metric map, and scores of many poses of a cloud at once."""

import numpy as np
from numba import njit


@njit(cache=True)
def cast(rays, origins, voxels, reach, step, free, surface):
    """The least depth to which each ray is free, and the greatest at which it meets a surface, over all origins.

    Args:
        rays: (N, 3) float64 voxels along each ray for every voxel along the optical axis, in the grid's axes.
        origins: (M, 3) float64 in voxels of the box; each ray is cast from each origin.
        voxels: (nx, ny, nz) int8 log-odds; voxels beyond the box are unknown.
        reach: voxels along the optical axis.
        step: voxels along the optical axis between the samples of a ray.
        free: (N,) float64, filled with voxels along the optical axis.
        surface: (N,) float64, filled likewise; infinite if the ray from any origin meets no surface.
    """
    for n in range(len(rays)):
        free[n], surface[n] = np.inf, 0.0
        for origin in origins:
            depth, is_occupied = _follow(rays[n], origin, voxels, reach, step)
            free[n] = min(free[n], depth)
            surface[n] = max(surface[n], depth if is_occupied else np.inf)


@njit(cache=True)
def _follow(ray, origin, voxels, reach, step):
    """Voxels along the optical axis to the end of the free part of a ray, and whether an occupied voxel ends it.

    Unknown voxels right before the camera, which sees nothing so near, are skipped.
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


@njit(cache=True)
def score(cloud, gain, places, yaws, field, scores):
    """The summed gains of a cloud at every place and yaw.

    Args:
        cloud: (P, 3) float32 points of a levelled robot, voxels from it.
        gain: (P, K) float32, what each point adds where the field holds 0 to K - 1.
        places: (C, 3) float32 of the robot, in voxels of the field, farther from its ends than the cloud reaches.
        yaws: (Y,) float64 rad.
        field: (nx, ny, nz) uint8.
        scores: (C, Y) float32, filled.
    """
    turned = np.empty((len(cloud), 2), np.float32)
    ny, nz = field.shape[1], field.shape[2]
    flat = field.ravel()
    for m in range(len(yaws)):
        c, s = np.float32(np.cos(yaws[m])), np.float32(np.sin(yaws[m]))
        for p in range(len(cloud)):
            turned[p, 0] = c * cloud[p, 0] - s * cloud[p, 1]
            turned[p, 1] = s * cloud[p, 0] + c * cloud[p, 1]
        for n in range(len(places)):
            x, y, z = places[n, 0], places[n, 1], places[n, 2]
            total = np.float32(0.0)
            for p in range(len(cloud)):
                i, j, k = int(x + turned[p, 0]), int(y + turned[p, 1]), int(z + cloud[p, 2])
                total += gain[p, flat[(i * ny + j) * nz + k]]
            scores[n, m] = total


@njit(cache=True)
def count_values(cloud, places, yaws, field, counts):
    """How often each point of a cloud meets each value of a field, over poses.

    Args:
        cloud, field: as for :func:`score`.
        places: (N, 3) float32 of the robot, in voxels of the field.
        yaws: (N,) float64 rad.
        counts: (P, K) int64 zeros, filled.
    """
    for n in range(len(places)):
        c, s = np.float32(np.cos(yaws[n])), np.float32(np.sin(yaws[n]))
        x, y, z = places[n, 0], places[n, 1], places[n, 2]
        for p in range(len(cloud)):
            i = int(x + c * cloud[p, 0] - s * cloud[p, 1])
            j = int(y + s * cloud[p, 0] + c * cloud[p, 1])
            counts[p, field[i, j, int(z + cloud[p, 2])]] += 1
