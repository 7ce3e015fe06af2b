"""Compiled functions that place and fill scans, which are boxes of marks, and add them to the map's log-odds."""

import numpy as np
from numba import njit

from pipeline.geometry.ray_kernels import HIT

WORD = np.dtype(np.uint64).itemsize
"""Number of marks along z that are read together as an unsigned integer."""


@njit(cache=True)
def box_around(points, block):
    """First index (x, y, z) and shape of the box of whole blocks around points (N, 3), voxels, and a margin of 1."""
    lower, upper = points[0] - 1, points[0] + 1
    for n in range(1, len(points)):
        for axis in range(3):
            lower[axis] = min(lower[axis], points[n, axis] - 1)
            upper[axis] = max(upper[axis], points[n, axis] + 1)
    first = np.floor(lower / block) * block
    shape = np.ceil(upper / block) * block - first
    return int(first[0]), int(first[1]), int(first[2]), int(shape[0]), int(shape[1]), int(shape[2])


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
def has_marks(words):
    """Whether a part of a scan, (nx, ny, nz / WORD) uint64, contains a mark."""
    for i in range(words.shape[0]):
        for j in range(words.shape[1]):
            for k in range(words.shape[2]):
                if words[i, j, k] != 0:
                    return True
    return False


@njit(cache=True, nogil=True)
def update_log_odds(words, log_odds, hit, miss, min_log_odds, max_log_odds):
    """Add a scan's marks to the log-odds of the same voxels.

    Args:
        words: (nx, ny, nz / WORD) uint64, each with WORD marks along z: 0 unseen, 1 free, 2 hit.
        log_odds: (nx, ny, nz) int8, changed in place.
        hit, miss: amounts that an end point adds and that a crossing ray subtracts.
        min_log_odds, max_log_odds: limits of the log-odds.
    """
    for i in range(words.shape[0]):
        for j in range(words.shape[1]):
            for k in range(words.shape[2]):
                word = words[i, j, k]
                if word != 0:
                    _update_word(
                        word, log_odds[i, j, k * WORD : (k + 1) * WORD], hit, miss, min_log_odds, max_log_odds
                    )


@njit(cache=True)
def _update_word(word, log_odds, hit, miss, min_log_odds, max_log_odds):
    """Add the marks of one word to the log-odds (WORD,) of the same voxels."""
    for n in range(WORD):
        mark = (word >> np.uint64(8 * n)) & np.uint64(0xFF)
        if mark != 0:
            gain = hit if mark == 2 else -miss
            log_odds[n] = min(max(log_odds[n] + gain, min_log_odds), max_log_odds)
