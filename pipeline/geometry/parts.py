"""Connected parts of point clouds."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage


def part_numbers(points: NDArray[np.floating], edge: float) -> NDArray[np.intp]:
    """(N,) number, starting at 1, of the connected part to which each point (N, 3), m, belongs.

    Points in the same cube of edge length ``edge``, m, or in neighbouring cubes are connected.
    """
    if not len(points):
        return np.zeros(0, np.intp)
    cubes = np.floor(points / edge).astype(np.int64)
    cubes -= cubes.min(axis=0)
    grid = np.zeros(cubes.max(axis=0) + 1, np.bool_)
    grid[tuple(cubes.T)] = True
    labels, _ = ndimage.label(grid, np.ones((3, 3, 3)))
    return np.asarray(labels[tuple(cubes.T)], np.intp)
