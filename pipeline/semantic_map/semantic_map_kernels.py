"""Loops over the points of a frame: a hash table of voxels with open addressing and linear probing.

The key of a voxel is that of :func:`pipeline.segments.cells.keys`; keys end 21 km from the origin. A table has 2ⁿ
slots; empty ones hold ``EMPTY``.
"""

import numpy as np
from numba import int64, njit, uint64

from pipeline.segments.cells import BITS, HALF

EMPTY = -1
FIBONACCI = 0x9E3779B97F4A7C15
"""2⁶⁴ over the golden ratio: multiplicative hashing, Knuth, The Art of Computer Programming 6.4."""


@njit(cache=True)
def accumulate(
    points, weights, unit, counts, per_metre, keys, indices, shift, voxels, voxel_keys, means, evidence, hits
):
    """Add points to the voxels that hold them, and return how many voxels there are then.

    Points that are not finite, too far out for a key, or without finite weights are left out.

    Args:
        points, weights: (N, 3) float32, and (N, C) evidence per class in the given ``unit``.
        counts: (N,) how many returns each point stands for.
        per_metre: number of voxels per metre.
        keys, indices: (2ⁿ,) int64 and int32, the table's keys and their voxels; more than half stay empty.
        shift: 64 - n.
        voxels: number of voxels so far.
        voxel_keys: (M,) int64 key of every voxel, M ≥ voxels + N; it and the others are changed in place.
        means, evidence, hits: (M, 3) float32 mean of the points of every voxel, (M, C) float32 sum of their
            weights, (M,) uint32 their number.
    """
    last_key, voxel = int64(EMPTY), 0
    for n in range(len(points)):
        key = voxel_key(points[n], per_metre)
        total = 0.0
        for c in range(weights.shape[1]):
            total += weights[n, c]
        if key == EMPTY or not 0 < total < np.inf:
            continue
        # Neighbouring pixels mostly share a voxel, so most points need no search in the table.
        if key != last_key:
            slot = find_slot(keys, shift, key)
            if keys[slot] == EMPTY:
                keys[slot], indices[slot], voxel_keys[voxels] = key, voxels, key
                means[voxels], evidence[voxels], hits[voxels] = 0.0, 0.0, 0
                voxels += 1
            last_key, voxel = key, indices[slot]
        hits[voxel] += counts[n]
        share, weight = counts[n] / hits[voxel], np.float32(counts[n] * unit)
        for c in range(3):
            means[voxel, c] += (points[n, c] - means[voxel, c]) * share
        for c in range(weights.shape[1]):
            evidence[voxel, c] += weights[n, c] * weight
    return voxels


@njit(cache=True)
def voxels_of(points, per_metre):
    """(N,) int32 voxel of every point (N, 3), EMPTY of those without a key, and the (M,) keys of the voxels."""
    bits, voxels, of_point = 10, 0, np.empty(len(points), np.int32)
    voxel_keys, last_key, voxel = np.empty(1 << bits, np.int64), int64(EMPTY), int64(EMPTY)
    keys, indices = np.full(2 << bits, EMPTY, np.int64), np.empty(2 << bits, np.int32)
    for n in range(len(points)):
        key = voxel_key(points[n], per_metre)
        if key != last_key and key != EMPTY:
            slot = find_slot(keys, 63 - bits, key)
            if keys[slot] == EMPTY:
                keys[slot], indices[slot], voxel_keys[voxels] = key, voxels, key
                voxels += 1
            last_key, voxel = key, int64(indices[slot])
        of_point[n] = voxel if key != EMPTY else EMPTY
        if voxels == 1 << bits:
            bits += 1
            keys, indices = np.full(2 << bits, EMPTY, np.int64), np.empty(2 << bits, np.int32)
            voxel_keys = np.append(voxel_keys, np.empty(voxels, np.int64))
            insert_all(keys, indices, 63 - bits, voxel_keys[:voxels])
    return of_point, voxel_keys[:voxels]


@njit(cache=True)
def insert_all(keys, indices, shift, voxel_keys):
    """Fill an empty table, (size,) keys and indices: ``voxel_keys[i]`` (N,) leads to ``i``."""
    for i in range(len(voxel_keys)):
        slot = find_slot(keys, shift, voxel_keys[i])
        keys[slot], indices[slot] = voxel_keys[i], i


@njit(cache=True, inline="always")
def voxel_key(point, per_metre):
    """The key of the voxel that holds the point (3,), or EMPTY; NaN fails every comparison."""
    i, j, k = np.floor(point[0] * per_metre), np.floor(point[1] * per_metre), np.floor(point[2] * per_metre)
    if not (abs(i) < HALF and abs(j) < HALF and abs(k) < HALF):
        return int64(EMPTY)
    return ((int64(i) + HALF) << BITS | (int64(j) + HALF)) << BITS | (int64(k) + HALF)


@njit(cache=True, inline="always")
def find_slot(keys, shift, key):
    """The slot of the table (size,) that holds the key, or the empty one where it belongs."""
    slot = int64((uint64(key) * uint64(FIBONACCI)) >> uint64(shift))
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = int64((slot + 1) & int64(keys.size - 1))
    return slot
