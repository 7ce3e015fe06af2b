"""Move points by a rigid transform."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def moved(T, points):
    """(N, 3) float32 points, m, moved by the 4×4 float64 transform ``T``.

    Unlike ``transform_points``, this function computes in double precision, because maps rebuilt from stored points
    must be identical.
    """
    result = np.empty(points.shape, np.float32)
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        for row in range(3):
            result[n, row] = T[row, 0] * x + T[row, 1] * y + T[row, 2] * z + T[row, 3]
    return result
