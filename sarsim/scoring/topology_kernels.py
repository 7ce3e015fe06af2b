"""The compiled search for shortest paths on a grid."""

import heapq

import numpy as np
from numba import njit


@njit(cache=True)
def shortest_path_length(i, j, goal_i, goal_j, free):
    """Length in cells of the shortest 8-connected path between two cells of a mask ``free`` (nx, ny); inf if none."""
    length = np.full(free.shape, np.inf)
    length[i, j] = 0.0
    heap = [(0.0, i, j)]
    while len(heap) > 0:
        so_far, i, j = heapq.heappop(heap)
        if i == goal_i and j == goal_j:
            return so_far
        if so_far > length[i, j]:
            continue
        for a in range(max(i - 1, 0), min(i + 2, free.shape[0])):
            for b in range(max(j - 1, 0), min(j + 2, free.shape[1])):
                new = so_far + np.hypot(a - i, b - j)
                if free[a, b] and new < length[a, b]:
                    length[a, b] = new
                    heapq.heappush(heap, (new, a, b))
    return np.inf
