"""Weighing a scan against the map."""

import numpy as np
from numba import njit

WORD = 8
"""Marks along z that are looked at together."""


@njit(cache=True)
def any_mark(words):
    """Is there a mark in a part of a scan? ``words``: (nx, ny, nz / WORD) uint64."""
    for i in range(words.shape[0]):
        for j in range(words.shape[1]):
            for k in range(words.shape[2]):
                if words[i, j, k] != 0:
                    return True
    return False


@njit(cache=True)
def fold(words, log_odds, hit, miss, least, greatest):
    """Add a scan's marks to the log-odds of the same voxels.

    Args:
        words: (nx, ny, nz / WORD) uint64, each WORD marks along z: 0 unseen, 1 free, 2 hit.
        log_odds: (nx, ny, nz) int8, changed in place.
        hit, miss: what an end point adds and a crossing takes.
        least, greatest: clamps.
    """
    for i in range(words.shape[0]):
        for j in range(words.shape[1]):
            for k in range(words.shape[2]):
                word = words[i, j, k]
                if word != 0:
                    _fold_word(word, log_odds[i, j, k * WORD : (k + 1) * WORD], hit, miss, least, greatest)


@njit(cache=True)
def _fold_word(word, log_odds, hit, miss, least, greatest):
    for n in range(WORD):
        mark = (word >> np.uint64(8 * n)) & np.uint64(0xFF)
        if mark != 0:
            gain = hit if mark == 2 else -miss
            log_odds[n] = min(max(log_odds[n] + gain, least), greatest)
