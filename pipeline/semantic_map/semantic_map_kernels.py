"""Loops over the points of a frame: a hash table of voxels with open addressing and linear probing.

The key of a voxel is that of :func:`pipeline.segments.cells.keys`; keys end 21 km from the origin. A table has 2ⁿ
slots; empty ones hold ``EMPTY``.
"""

import numpy as np
from numba import int64, njit, uint64

from pipeline.segments.cells import BITS, HALF

EMPTY = -1
NOWHERE = -HALF
"""Index of a point without a voxel."""
FIBONACCI = 0x9E3779B97F4A7C15
"""2⁶⁴ over the golden ratio: multiplicative hashing, Knuth, The Art of Computer Programming 6.4."""


@njit(cache=True)
def accumulate(points, weights, unit, counts, per_metre, keys, indices, shift, block_keys, blocks, rows, size):
    """Add points to the voxels that hold them, and return how many blocks and voxels there are then.

    Points that are not finite, too far out for a key, or without finite weights are left out.

    Args:
        points, weights: (N, 3) float32, and (N, C) evidence per class in the given ``unit``.
        counts: (N,) how many returns each point is the mean of.
        per_metre: number of voxels per metre.
        keys, indices: (2ⁿ,) int64 and int32, the table's keys and their blocks; more than half stay empty.
        shift: 64 - n.
        block_keys, blocks: (B,) int64 key of every block of 4 × 4 × 4 voxels, and (B, 64) int32 these, EMPTY of those
            not there; B is at least N more than there are.
        rows: (M, 4 + C) float32, of every voxel how many returns it has, their mean and the sums of their weights.
        size: numbers of blocks and voxels so far.
    """
    number, voxels = size
    last_key, block = int64(EMPTY), int64(0)
    for n in range(len(points)):
        total = 0.0
        for c in range(weights.shape[1]):
            total += weights[n, c]
        i, j, k = (
            np.floor(points[n, 0] * per_metre),
            np.floor(points[n, 1] * per_metre),
            np.floor(points[n, 2] * per_metre),
        )
        if not (abs(i) < HALF and abs(j) < HALF and abs(k) < HALF and 0 < total < np.inf):
            continue
        i, j, k = int64(i), int64(j), int64(k)
        key = packed(i >> 2, j >> 2, k >> 2)
        # Neighbouring points mostly share a block, so most need no search in the table.
        if key != last_key:
            slot = find_slot(keys, shift, key)
            if keys[slot] == EMPTY:
                keys[slot], indices[slot], block_keys[number] = key, number, key
                blocks[number] = EMPTY
                number += 1
            last_key, block = key, int64(indices[slot])
        cell = (i & 3) << 4 | (j & 3) << 2 | (k & 3)
        if blocks[block, cell] == EMPTY:
            blocks[block, cell] = voxels
            rows[voxels] = 0.0
            voxels += 1
        row = rows[blocks[block, cell]]
        row[0] += counts[n]
        share, weight = np.float32(counts[n] / row[0]), np.float32(counts[n] * unit)
        for c in range(3):
            row[1 + c] += (points[n, c] - row[1 + c]) * share
        for c in range(weights.shape[1]):
            row[4 + c] += weights[n, c] * weight
    return number, voxels


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
    """The key of the voxel that holds the point (3,), or EMPTY."""
    i, j, k = indices_of(point, per_metre)
    return packed(i, j, k) if i != NOWHERE else int64(EMPTY)


@njit(cache=True, inline="always")
def indices_of(point, per_metre):
    """The indices of the voxel that holds the point (3,), the first NOWHERE if none does, as of NaN."""
    i, j, k = np.floor(point[0] * per_metre), np.floor(point[1] * per_metre), np.floor(point[2] * per_metre)
    if not (abs(i) < HALF and abs(j) < HALF and abs(k) < HALF):
        return int64(NOWHERE), int64(0), int64(0)
    return int64(i), int64(j), int64(k)


@njit(cache=True, inline="always")
def packed(i, j, k):
    """The key of the indices (i, j, k), int64."""
    return ((i + HALF) << BITS | (j + HALF)) << BITS | (k + HALF)


@njit(cache=True, inline="always")
def find_slot(keys, shift, key):
    """The slot of the table (size,) that holds the key, or the empty one where it belongs."""
    slot = int64((uint64(key) * uint64(FIBONACCI)) >> uint64(shift))
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = int64((slot + 1) & int64(keys.size - 1))
    return slot
