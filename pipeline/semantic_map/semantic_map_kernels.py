"""Compiled loops that add the points of a frame to voxels, whose blocks are found in a hash table."""

import numpy as np
from numba import int64, njit

from pipeline.geometry.voxel_hash_kernels import EMPTY, NO_INDEX, find_slot, indices_of, packed, unpacked

BLOCK = 4
"""Number of voxels along each side of a block."""
COLUMN = 4
"""Number of blocks along each side of a column, which is as high as the map."""
GONE = np.iinfo(np.int64).max
"""Value of ``first_hit`` for a voxel that was removed."""


@njit(cache=True, nogil=True)
def accumulate(
    points, weights, unit, counts, per_metre, keys, indices, shift, block_keys, blocks, rows, first_hit, first,
    columns, free, size,
):  # fmt: skip
    """Add points to the voxels that contain them; return the numbers of blocks, rows and free rows afterwards.

    A point is left out if it is not finite, too far from the origin for a key, or outside the chosen columns, or if
    the sum of its weights is not positive and finite.

    Args:
        points, weights: (N, 3) float32, and (N, C) evidence for every class in the given ``unit``.
        counts: (N,) number of returns averaged in each point.
        per_metre: number of voxels per metre.
        keys, indices: (2ⁿ,) int64 and int32, the table's keys and the rows of their blocks; at least half stay empty.
        shift: 64 - n.
        block_keys, blocks: (B,) int64 key of every block of 4 × 4 × 4 voxels, and (B, 64) int32 rows of its voxels,
            EMPTY for voxels without points. B exceeds the number of blocks so far by at least N.
        rows: (M, 4 + C) float32, for every voxel its number of returns, their mean and the sums of their weights.
        first_hit: (M,) int64, for every voxel the serial number of the first point that hit it.
        first: serial number of points[0].
        columns: (2,) index of the first column, and (nx, ny) bool mask of the chosen columns; an empty mask chooses
            all columns.
        free: (F,) int32 rows of removed voxels, which are reused first.
        size: numbers of blocks, rows and free rows so far.
    """
    (number, used, left), are_all = size, columns[1].size == 0
    last_key, block = int64(EMPTY), int64(EMPTY)
    for n in range(len(points)):
        total = 0.0
        for c in range(weights.shape[1]):
            total += weights[n, c]
        i, j, k = indices_of(points[n], per_metre)
        if i == NO_INDEX or not 0 < total < np.inf:
            continue
        key = packed(i >> 2, j >> 2, k >> 2)
        # Neighbouring points mostly share a block, so most points need no search in the table.
        if key != last_key:
            last_key, block = key, int64(EMPTY)
            if are_all or _is_chosen(i >> 2, j >> 2, columns):
                slot = find_slot(keys, shift, key)
                if keys[slot] == EMPTY:
                    keys[slot], indices[slot], block_keys[number] = key, number, key
                    blocks[number] = EMPTY
                    number += 1
                block = int64(indices[slot])
        if block == EMPTY:
            continue
        cell = (i & 3) << 4 | (j & 3) << 2 | (k & 3)
        if blocks[block, cell] == EMPTY:
            new = free[left - 1] if left else used
            blocks[block, cell] = new
            rows[new], first_hit[new] = 0.0, first + n
            left, used = (left - 1, used) if left else (left, used + 1)
        row = rows[blocks[block, cell]]
        row[0] += counts[n]
        share, weight = np.float32(counts[n] / row[0]), np.float32(counts[n] * unit)
        for c in range(3):
            row[1 + c] += (points[n, c] - row[1 + c]) * share
        for c in range(weights.shape[1]):
            row[4 + c] += weights[n, c] * weight
    return number, used, left


@njit(cache=True, inline="always")
def _is_chosen(i, j, columns):
    """Whether the column that contains the blocks with indices ``i`` and ``j`` along x and y is chosen."""
    low, chosen = columns
    u, v = i // COLUMN - low[0], j // COLUMN - low[1]
    return 0 <= u < chosen.shape[0] and 0 <= v < chosen.shape[1] and chosen[u, v]


@njit(cache=True, nogil=True)
def forget(block_keys, blocks, first_hit, columns):
    """Empty the ``blocks`` (B, 64) of the chosen columns; mark their voxels as GONE, and return the voxels' rows.

    For the arguments, see :func:`accumulate`.
    """
    index, free, size = unpacked(block_keys), np.empty(len(first_hit), np.int32), 0
    for b in range(len(blocks)):
        if _is_chosen(index[b, 0], index[b, 1], columns):
            for cell in range(blocks.shape[1]):
                if blocks[b, cell] != EMPTY:
                    first_hit[blocks[b, cell]], free[size] = GONE, blocks[b, cell]
                    size += 1
            blocks[b] = EMPTY
    return free[:size].copy()


@njit(cache=True, nogil=True)
def class_fractions(classes, share, whole, size):
    """(N, ``size``) uint8: ``share`` (N,) for the first of ``classes`` (N, 2), ``whole - share`` for the second."""
    result = np.zeros((len(share), size), np.uint8)
    for n in range(len(share)):
        result[n, classes[n, 0]] = share[n]
        result[n, classes[n, 1]] = whole - share[n]
    return result
