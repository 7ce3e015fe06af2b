"""Kernels that score many poses of a cloud at once."""

import numpy as np
from numba import njit


@njit(cache=True)
def score(cloud, gain, places, yaws, field, scores):
    """Sum the gains of a cloud's points at every position and yaw of the robot.

    Args:
        cloud: (P, 3) float32 points relative to the levelled robot, in voxels.
        gain: (P, K) float32 gain of each point for each value of the field, 0 to K - 1.
        places: (C, 3) float32 robot positions in voxels of the field, farther from its ends than the cloud reaches.
        yaws: (Y,) float64 yaws of the robot, rad.
        field: (nx, ny, nz) uint8 values of voxels, 0 to K - 1.
        scores: (C, Y) float32, filled with the sums.
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
    """Count the poses in which each point of a cloud lies in a voxel with each value of a field.

    Args:
        cloud, field: as for :func:`score`.
        places: (N, 3) float32 positions of the robot, in voxels of the field.
        yaws: (N,) float64 yaws of the robot, rad.
        counts: (P, K) int64 counts, initially 0.
    """
    for n in range(len(places)):
        c, s = np.float32(np.cos(yaws[n])), np.float32(np.sin(yaws[n]))
        x, y, z = places[n, 0], places[n, 1], places[n, 2]
        for p in range(len(cloud)):
            i = int(x + c * cloud[p, 0] - s * cloud[p, 1])
            j = int(y + s * cloud[p, 0] + c * cloud[p, 1])
            counts[p, field[i, j, int(z + cloud[p, 2])]] += 1
