"""Rays through voxels of the metric map, and scores of many poses of a cloud at once."""

import numpy as np
from numba import njit


@njit(cache=True)
def cast(rays, origin, voxels, step, reach, depth, is_occupied):
    """How far the map knows every ray to be free, and whether a surface ends it.

    Args:
        rays: (N, 3) float64 voxels along each ray for every voxel along the optical axis, in the grid's axes.
        origin: (3,) float64 of all rays, in voxels of the box.
        voxels: (nx, ny, nz) int8 log-odds; what lies beyond is unknown.
        step, reach: voxels along the optical axis from sample to sample, and of the farthest.
        depth: (N,) float64, filled with voxels along the optical axis up to what is not free.
        is_occupied: (N,) bool, filled.
    """
    nx, ny, nz = voxels.shape
    for n in range(len(rays)):
        z = 0.0
        depth[n], is_occupied[n] = reach, False
        seen_free = False
        while z < reach:
            i = int(np.floor(origin[0] + rays[n, 0] * z))
            j = int(np.floor(origin[1] + rays[n, 1] * z))
            k = int(np.floor(origin[2] + rays[n, 2] * z))
            inside = 0 <= i < nx and 0 <= j < ny and 0 <= k < nz
            value = voxels[i, j, k] if inside else 0
            if value > 0 or (value == 0 and seen_free):
                depth[n], is_occupied[n] = z, value > 0
                break
            seen_free = seen_free or value < 0
            z += step
        if not seen_free and not is_occupied[n]:
            depth[n] = 0.0


@njit(cache=True)
def score(cloud, gain, places, yaws, field, scores):
    """The summed gains of a cloud at every place and yaw.

    Args:
        cloud: (P, 3) float32 points of a levelled robot, voxels from it.
        gain: (P, K) float32, what each point adds where the field holds 0 to K - 1.
        places: (C, 3) float32 of the robot, in voxels of the field, so far from its end as the cloud reaches.
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
