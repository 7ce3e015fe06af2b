"""The loop over the returns that show the ground."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def see(points, origin, cell, height, near, seen):
    """Mark in ``seen`` the cells in which points lie that are nearer than ``near`` m to the ground.

    Args:
        points: (N, 3) m.
        origin: (2,) m, corner of the element [0, 0].
        cell: side of a cell, m.
        height: (nx, ny) m of the ground; NaN where there is none.
        near: m.
        seen: (nx, ny) bool.
    """
    for n in range(len(points)):
        i, j = int(np.floor((points[n, 0] - origin[0]) / cell)), int(np.floor((points[n, 1] - origin[1]) / cell))
        is_inside = 0 <= i < seen.shape[0] and 0 <= j < seen.shape[1]
        if is_inside and abs(points[n, 2] - height[i, j]) < near:
            seen[i, j] = True
