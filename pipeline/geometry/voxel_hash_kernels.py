"""A hash table of voxels with open addressing and linear probing.

A key packs the three indices of a voxel, and keys are ordered like indices. A table has 2ⁿ slots; free slots are
EMPTY.
"""

import numpy as np
from numba import int64, njit, uint64

INDEX_BITS = 21
"""Number of bits of a key for each of a voxel's three indices."""
INDEX_LIMIT = 1 << (INDEX_BITS - 1)
"""Limit of a voxel's indices; a voxel at this distance from the origin or farther, along any axis, has no key."""
EMPTY = -1
"""Key of a free slot, and of a point without a voxel."""
NO_INDEX = -INDEX_LIMIT
"""Index of a point without a voxel."""
FIBONACCI = 0x9E3779B97F4A7C15
"""2⁶⁴ over the golden ratio, for multiplicative hashing (Knuth, The Art of Computer Programming 6.4)."""


@njit(cache=True)
def voxels_of(points, per_unit):
    """(N,) int32 index of the key of each point's voxel, and the (M,) int64 keys in the order of their first points.

    The index is EMPTY for points (N, 3) that are not finite or too far from the origin for a key. ``per_unit`` is the
    number of voxels per unit of the points' coordinates.
    """
    bits, count, of_point = 10, 0, np.empty(len(points), np.int32)
    voxel_keys, last_key, voxel = np.empty(1 << bits, np.int64), int64(EMPTY), int64(EMPTY)
    keys, indices = np.full(2 << bits, EMPTY, np.int64), np.empty(2 << bits, np.int32)
    for n in range(len(points)):
        key = voxel_key(points[n], per_unit)
        if key != last_key and key != EMPTY:
            slot = find_slot(keys, 63 - bits, key)
            if keys[slot] == EMPTY:
                keys[slot], indices[slot], voxel_keys[count] = key, count, key
                count += 1
            last_key, voxel = key, int64(indices[slot])
        of_point[n] = voxel if key != EMPTY else EMPTY
        if count == 1 << bits:
            bits += 1
            keys, indices = np.full(2 << bits, EMPTY, np.int64), np.empty(2 << bits, np.int32)
            voxel_keys = np.append(voxel_keys, np.empty(count, np.int64))
            insert_all(keys, indices, 63 - bits, voxel_keys[:count])
    return of_point, voxel_keys[:count]


@njit(cache=True)
def insert_all(keys, indices, shift, voxel_keys):
    """Fill an empty table, (size,) ``keys`` and ``indices``, to map ``voxel_keys[i]`` (N,) to ``i``."""
    for i in range(len(voxel_keys)):
        slot = find_slot(keys, shift, voxel_keys[i])
        keys[slot], indices[slot] = voxel_keys[i], i


@njit(cache=True, inline="always")
def voxel_key(point, per_unit):
    """The key of the voxel that contains the point (3,), or EMPTY."""
    i, j, k = indices_of(point, per_unit)
    return packed(i, j, k) if i != NO_INDEX else int64(EMPTY)


@njit(cache=True, inline="always")
def indices_of(point, per_unit):
    """Indices of the voxel that contains a point (3,); the first is NO_INDEX if the point is NaN or too far away."""
    i, j, k = np.floor(point[0] * per_unit), np.floor(point[1] * per_unit), np.floor(point[2] * per_unit)
    if not (abs(i) < INDEX_LIMIT and abs(j) < INDEX_LIMIT and abs(k) < INDEX_LIMIT):
        return int64(NO_INDEX), int64(0), int64(0)
    return int64(i), int64(j), int64(k)


@njit(cache=True, inline="always")
def packed(i, j, k):
    """The key of the indices (i, j, k), int64."""
    return ((i + INDEX_LIMIT) << INDEX_BITS | (j + INDEX_LIMIT)) << INDEX_BITS | (k + INDEX_LIMIT)


@njit(cache=True, inline="always")
def find_slot(keys, shift, key):
    """The slot of the table (size,) that holds the key, or the empty slot into which it belongs."""
    slot = int64((uint64(key) * uint64(FIBONACCI)) >> uint64(shift))
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = int64((slot + 1) & int64(keys.size - 1))
    return slot


@njit(cache=True)
def unpacked(keys):
    """(M, 3) int32 indices of the voxels of (M,) keys."""
    result, mask = np.empty((len(keys), 3), np.int32), (1 << INDEX_BITS) - 1
    for n in range(len(keys)):
        for axis in range(3):
            result[n, axis] = (keys[n] >> (2 - axis) * INDEX_BITS & mask) - INDEX_LIMIT
    return result
