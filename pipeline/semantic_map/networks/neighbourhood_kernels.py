"""Farthest point sampling."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, boundscheck=False)
def farthest_points(points, chosen):
    """Choose points one by one, each the farthest from those chosen before; the first is farthest from the mean.

    Args:
        points: (N, 3) float32, m.
        chosen: (Q,) int64, filled with indices; Q ≤ N.
    """
    count = len(points)
    middle = np.zeros(3, np.float32)
    for c in range(3):
        middle[c] = points[:, c].mean()
    distance = np.empty(count, np.float32)
    x, y, z = middle[0], middle[1], middle[2]
    for q in range(-1, len(chosen)):
        if q >= 0:
            x, y, z = points[chosen[q], 0], points[chosen[q], 1], points[chosen[q], 2]
        farthest, greatest = 0, np.float32(-1)
        for i in range(count):
            d = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2
            # Distances to the middle decide only on the first point: points near the middle may be chosen later.
            d = min(d, distance[i]) if q > 0 else d
            distance[i] = d
            farthest, greatest = (i, d) if d > greatest else (farthest, greatest)
        if q + 1 < len(chosen):
            chosen[q + 1] = farthest
