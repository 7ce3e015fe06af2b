"""Farthest point sampling."""

import numpy as np
from numba import njit

CHUNK = 256
"""Number of values whose maximum is found in one loop without conditions, which a compiler can vectorise."""


@njit(cache=True, nogil=True, boundscheck=False)
def farthest_points(points, chosen):
    """Choose points in turn, each the farthest from all chosen points; the first is the farthest from the mean.

    Args:
        points: (N, 3) float32, m.
        chosen: (Q,) int64, filled with indices; Q ≤ N.
    """
    xs, ys, zs = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    x, y, z = np.float32(xs.mean()), np.float32(ys.mean()), np.float32(zs.mean())
    distance = np.full(len(points), np.float32(np.inf))
    for q in range(len(chosen)):
        for i in range(len(points)):
            dx, dy, dz = xs[i] - x, ys[i] - y, zs[i] - z
            d, least = dx * dx + dy * dy + dz * dz, distance[i]
            distance[i] = d if d < least else least
        farthest = index_of_max(distance.view(np.int32))  # as integers, positive floats keep their order
        if q == 0:
            # Distances from the mean determine only the first point: points near the mean may be chosen later.
            distance[:] = np.inf
        chosen[q] = farthest
        x, y, z = xs[farthest], ys[farthest], zs[farthest]


@njit(cache=True, nogil=True, boundscheck=False)
def index_of_max(values):
    """Index of the first maximum of (N,) int32 ``values``, none of which is negative."""
    largest, place = np.int32(-1), 0
    for start in range(0, len(values), CHUNK):
        here = np.int32(-1)
        for i in range(start, min(start + CHUNK, len(values))):
            here = max(here, values[i])
        if here > largest:
            largest, place = here, start
    while values[place] < largest:
        place += 1
    return place
