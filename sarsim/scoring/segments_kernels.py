"""The compiled loop over the returns that show a surface."""

import numpy as np
from numba import int64, njit

ROW_STRIDE = 1 << 32
"""Difference between the keys of two cells that are neighbours along the first axis."""


@njit(cache=True, nogil=True)
def cells_on_plane(points, normal, offset, axes, near, cell):
    """(K,) int64 keys of the cells that contain points on a plane; consecutive keys differ.

    Args:
        points: (N, 3) m.
        normal, offset: (3,) unit normal and offset in m of the plane n·p = offset.
        axes: (3, 2) unit vectors in the plane.
        near: maximum distance of a point from the plane, m.
        cell: edge length of a cell, m.
    """
    keys, count = np.empty(len(points), np.int64), 0
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        if abs(x * normal[0] + y * normal[1] + z * normal[2] - offset) < near:
            i = int64(np.floor((x * axes[0, 0] + y * axes[1, 0] + z * axes[2, 0]) / cell))
            j = int64(np.floor((x * axes[0, 1] + y * axes[1, 1] + z * axes[2, 1]) / cell))
            key = i * ROW_STRIDE + j
            if count == 0 or key != keys[count - 1]:
                keys[count] = key
                count += 1
    return keys[:count]
