"""Loops over the points of a frame: open-addressing hash tables of voxels, linear probing.

A voxel's key is ``(((i · 2²⁰) + j) · 2²⁰ + k) · 8 + tag`` with its indices shifted to be non-negative. Keys of points
beyond ±2¹⁹ voxels, and of points that are not finite, do not exist. A table has 2ⁿ slots, empty ones hold ``EMPTY``.
"""

import numpy as np
from numba import int64, njit, uint64

EMPTY = -1
HALF = 1 << 19
FIBONACCI = 0x9E3779B97F4A7C15
"""2⁶⁴ over the golden ratio: Knuth's multiplicative hash, The Art of Computer Programming 6.4."""


@njit(cache=True, inline="always")
def voxel_key(x, y, z, per_metre, tag):
    """The key of the voxel that holds the point, or EMPTY if there is none; NaN fails every comparison."""
    i, j, k = np.floor(x * per_metre), np.floor(y * per_metre), np.floor(z * per_metre)
    if not (abs(i) < HALF and abs(j) < HALF and abs(k) < HALF):
        return EMPTY
    return index_key(int64(i), int64(j), int64(k), int64(tag))


@njit(cache=True, inline="always")
def index_key(i, j, k, tag):
    """The key of voxel (i, j, k)."""
    return (((i + HALF) << 20 | (j + HALF)) << 20 | (k + HALF)) << 3 | tag


@njit(cache=True, inline="always")
def find_slot(keys, shift, key):
    """The slot that holds ``key``, or the empty one where it belongs."""
    slot = int64((uint64(key) * uint64(FIBONACCI)) >> uint64(shift))
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = int64((slot + 1) & int64(keys.size - 1))
    return slot


@njit(cache=True)
def insert_all(keys, indices, shift, new_keys):
    """Fill an empty table: ``new_keys[i]`` maps to ``i``."""
    for i in range(new_keys.size):
        slot = find_slot(keys, shift, new_keys[i])
        keys[slot] = new_keys[i]
        indices[slot] = i


@njit(cache=True)
def accumulate(
    points, weights, tags, per_metre, keys, indices, shift, count, voxel_keys, means, evidence, hits
):
    """Add points to the voxels that hold them and return the number of voxels.

    Args:
        points: (N, 3) float32.
        weights: (N, C) float32 evidence per class; points with a weight that is not finite are left out.
        tags: (N,) uint8 below 8: points of one voxel and different tags are kept apart.
        per_metre: voxels per metre.
        keys, indices, shift: the table, with more than ``count + N`` slots.
        count: voxels so far.
        voxel_keys, means, evidence, hits: (M,), (M, 3), (M, C), (M,), M ≥ count + N, changed in place.
    """
    last_key, voxel = EMPTY, 0
    for n in range(points.shape[0]):
        key = voxel_key(points[n, 0], points[n, 1], points[n, 2], per_metre, tags[n])
        if key == EMPTY or not np.isfinite(weights[n].sum()):
            continue
        # Neighbouring pixels mostly share a voxel: most points need no look into the table.
        if key != last_key:
            slot = find_slot(keys, shift, key)
            if keys[slot] == EMPTY:
                keys[slot], indices[slot], voxel_keys[count] = key, count, key
                means[count], evidence[count], hits[count] = 0.0, 0.0, 0
                count += 1
            last_key, voxel = key, indices[slot]
        hits[voxel] += 1
        for c in range(3):
            means[voxel, c] += (points[n, c] - means[voxel, c]) / hits[voxel]
        for c in range(weights.shape[1]):
            evidence[voxel, c] += weights[n, c]
    return count
