"""Loops over the points of a look that vote on the class of their plane."""

import numpy as np
from numba import njit

NONE = -1
"""No plane."""


@njit(cache=True)
def mean_logs(logs, plane, planes):
    """(P, C) float64 mean of (N, C) float32 logarithms over the points of each plane, 0 where there are none.

    Args:
        logs: (N, C) float32.
        plane: (N,) int32 of every point, or NONE.
        planes: P, their number.
    """
    sums, counts = np.zeros((planes, logs.shape[1])), np.zeros(planes, np.int64)
    for i in range(len(logs)):
        if plane[i] != NONE:
            counts[plane[i]] += 1
            for c in range(logs.shape[1]):
                sums[plane[i], c] += logs[i, c]
    for p in range(planes):
        sums[p] /= max(counts[p], 1)
    return sums


@njit(cache=True)
def normalised_products(probabilities, logs, evidence, plane):
    """(N, C) float32: exp(``logs`` + ``evidence`` of the plane), divided by its sum; points on none keep theirs.

    Args:
        probabilities: (N, C) float32.
        logs: (N, C) float32, their logarithms.
        evidence: (P, C) float64, logarithms.
        plane: (N,) int32 of every point, or NONE.
    """
    result = probabilities.copy()
    for i in range(len(logs)):
        if plane[i] == NONE:
            continue
        total = 0.0
        for c in range(logs.shape[1]):
            result[i, c] = np.exp(logs[i, c] + evidence[plane[i], c])
            total += result[i, c]
        for c in range(logs.shape[1]):
            result[i, c] /= total
    return result
