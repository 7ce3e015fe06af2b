"""Sets of 5 cm cells of the map, which show where inside its bounding box a surface is.

A set is a (K, 3) int32 array of distinct indices, sorted. The cells are the map's, not the surface's, so sets of
different frames unite exactly and in any order.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from pipeline.geometry import cells_kernels as kernels

NONE = -1
"""No piece."""
SURFACE_CELL = 0.05
"""m, the edge of a cell. Centres lie at its multiples: there floors and walls tend to lie, and noise would spread one
on the face between two cells over both."""
JOINED = 2
"""Cells up to this far apart along every axis are neighbours: gaps of 0.15 m always part, gaps of 0.05 m never do. So
are blocks of an image."""
FRONT = (JOINED + 1) ** 2 + 1
"""Least number of cells of a set near another set that make both one surface: one more than at a corner."""
FRAYED = 0.25
"""A cell with less than this share of the points of another neighbour is noise at the surface's edge."""

Cells = NDArray[np.int32]


def cells_of(points: NDArray) -> tuple[Cells, NDArray[np.intp]]:
    """The (K, 3) cells that contain (N, 3) points in m, and the (N,) row of each point's cell."""
    cell_of, packed = kernels.cells_of(
        np.asarray(points, np.float32) + np.float32(SURFACE_CELL / 2), np.float32(1 / SURFACE_CELL)
    )
    order = packed.argsort()
    return from_keys(packed[order]), order.argsort()[cell_of]


def centres(cells: Cells) -> NDArray[np.float64]:
    """(K, 3) centres in m."""
    return np.multiply(cells, SURFACE_CELL, dtype=np.float64)


def unite(a: Cells, b: Cells) -> Cells:
    """The cells of both sets."""
    return kernels.united(a, b)


def thinned(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """(M, 3) the first of the points (N, 3), m, in each cube with half the edge of a cell."""
    cube_of, cubes = kernels.cells_of(points, np.float32(2 / SURFACE_CELL))
    first = np.empty(len(cubes), np.intp)
    first[cube_of[::-1]] = np.arange(len(cube_of))[::-1]
    return points[first]


def parts(points: NDArray[np.floating], edge: float) -> NDArray[np.intp]:
    """(N,) number from 1 on of the part of each point (N, 3), m, at least one.

    Points in one cube with an ``edge`` in m, or in neighbouring ones, are of one part.
    """
    cubes = np.floor(points / edge).astype(np.int64)
    cubes -= cubes.min(axis=0)
    grid = np.zeros(cubes.max(axis=0) + 1, np.bool_)
    grid[tuple(cubes.T)] = True
    labels, _ = ndimage.label(grid, np.ones((3, 3, 3)))
    return np.asarray(labels[tuple(cubes.T)], np.intp)


def in_contact(a: Cells, b: Cells) -> bool:
    """Whether two sets meet along a front, not only at a corner."""
    small, large = (a, b) if len(a) < len(b) else (b, a)
    return kernels.count_near(small, large, JOINED, FRONT) >= FRONT


def connected_pieces(cells: Cells, points: NDArray[np.intp]) -> NDArray[np.intp]:
    """(K,) number of each cell's piece, NONE for cells that are only noise at a surface's edge.

    Cells with few ``points`` (K,) beside cells with many are noise. Of the others, neighbouring inner cells form one
    piece, and each remaining cell joins the nearest piece, as in DBSCAN (Ester et al. 1996) and a watershed: so
    surfaces that touch at corners or by a thin strip stay two. An inner cell of a level or upright surface lacks at
    most one row of the square of its neighbours.
    """
    side = 2 * JOINED + 1
    pairs = KDTree(cells).query_pairs(JOINED, p=np.inf, output_type="ndarray")
    frayed = np.zeros(len(cells), bool)
    for one, other in (pairs.T, pairs.T[::-1]):
        frayed[one[points[one] < FRAYED * points[other]]] = True
    pairs = pairs[~frayed[pairs].any(axis=1)]
    inner = np.bincount(pairs.ravel(), minlength=len(cells)) + 1 >= side * (side - 1)
    piece = np.where(inner, _components(pairs[inner[pairs].all(axis=1)], len(cells)), NONE)
    _flood(piece, pairs)
    apart = _components(pairs[(piece[pairs] == NONE).all(axis=1)], len(cells)) + len(cells)
    return np.where(frayed, NONE, np.where(piece == NONE, apart, piece))


def _components(pairs: NDArray[np.intp], size: int) -> NDArray[np.intp]:
    graph = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(size, size))
    return connected_components(graph, directed=False)[1].astype(np.intp)


def _flood(piece: NDArray[np.intp], pairs: NDArray[np.intp]) -> None:
    """Spread pieces step by step to the cells without one, in place; of several pieces the lowest number wins."""
    both_ways = np.vstack([pairs, pairs[:, ::-1]])
    while True:
        source, target = both_ways[(piece[both_ways] == NONE) @ [1, 2] == 2].T
        if not len(target):
            return
        reached = np.full(len(piece), len(piece))
        np.minimum.at(reached, target, piece[source])
        piece[target] = reached[target]


def from_keys(packed: NDArray[np.int64]) -> Cells:
    """(K, 3) cells of (K,) keys of the kernels."""
    mask = (1 << kernels.BITS) - 1
    indices = np.stack([packed >> 2 * kernels.BITS, packed >> kernels.BITS & mask, packed & mask], axis=1)
    return (indices - kernels.HALF).astype(np.int32)
