"""The compiled loop over the returns that show the ground."""

from numba import njit

from pipeline.geometry.cells_kernels import cell_at


@njit(cache=True, nogil=True)
def see(points, origin, cell, height, near, seen):
    """Mark the cells in ``seen`` that contain a point less than ``near`` m above or below their ground.

    Args:
        points: (N, 3) m.
        origin: (2,) m, lower corner of cell [0, 0].
        cell: side of a cell, m.
        height: (nx, ny) height of the ground, m; NaN where there is none.
        near: maximum vertical distance of a point from the ground, m.
        seen: (nx, ny) bool, changed in place.
    """
    for n in range(len(points)):
        i, j = cell_at(points[n, 0], points[n, 1], origin, cell)
        is_inside = 0 <= i < seen.shape[0] and 0 <= j < seen.shape[1]
        if is_inside and abs(points[n, 2] - height[i, j]) < near:
            seen[i, j] = True
