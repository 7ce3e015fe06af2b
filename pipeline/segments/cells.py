"""Sets of 5 cm cells of the map, which show where inside its bounding box a surface is.

A set is a (K, 3) int32 array of distinct indices, sorted. The cells are the map's, not the surface's, so sets of
different frames unite exactly and in any order.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from pipeline.segments import cells_kernels as kernels

CELL = 0.05  # m, the edge of a cell
SHIFT = 0.02
"""m, of the grid against the map's axes: floors and walls tend to lie at round numbers, on unshifted cell faces."""
REACH = 2
"""Cells up to this far apart along every axis are neighbours: gaps of 0.15 m always part, gaps of 0.05 m never do."""
INNER = 20
"""Least number of cells in reach of an inner cell, itself included: 25 inside a surface, 20 beside its edge (15)."""
CONTACT = 12
"""Cells in reach of another set, or three quarters of the smaller set, that make both one surface; corners have 9."""
FRAYED = 0.25
"""A cell with less than this share of the points of another cell in reach is noise at the surface's edge."""
NONE = -1  # No piece

Cells = NDArray[np.int32]


def cells_of(points: NDArray) -> tuple[Cells, NDArray[np.intp]]:
    """The (K, 3) cells that contain (N, 3) points in m, and the (N,) row of each point's cell."""
    cell_of, packed = kernels.cells_of(np.asarray(points, np.float32) + np.float32(SHIFT), np.float32(1 / CELL))
    order = packed.argsort()
    return from_keys(packed[order]), order.argsort()[cell_of]


def centres(cells: Cells) -> NDArray[np.float64]:
    """(K, 3) centres in m."""
    return cells.astype(np.float64) * CELL + (CELL / 2 - SHIFT)


def unite(a: Cells, b: Cells) -> Cells:
    """The cells of both sets."""
    return from_keys(np.union1d(keys(a), keys(b)))


def in_contact(a: Cells, b: Cells) -> bool:
    """Whether two sets meet along a front, not only at a corner."""
    small, large = (a, b) if len(a) < len(b) else (b, a)
    near = _near_box_of(small, large), _near_box_of(large, small)
    if not len(near[0]) or not len(near[1]):
        return False
    distances, _ = KDTree(near[1]).query(near[0], p=np.inf, distance_upper_bound=REACH + 0.5)
    return bool(np.isfinite(distances).sum() >= min(CONTACT, 0.75 * len(small)))


def connected_pieces(cells: Cells, points: NDArray[np.intp]) -> NDArray[np.intp]:
    """(K,) number of each cell's piece, NONE for cells that are only noise at a surface's edge.

    Cells with few ``points`` (K,) beside cells with many are noise. Of the others, inner cells in reach of each other
    form one piece, and each remaining cell joins the nearest piece, as in DBSCAN (Ester et al. 1996) and a watershed:
    so surfaces that touch at corners or by a thin strip stay two.
    """
    pairs = KDTree(cells).query_pairs(REACH + 0.5, p=np.inf, output_type="ndarray")
    frayed = np.zeros(len(cells), bool)
    for one, other in (pairs.T, pairs.T[::-1]):
        frayed[one[points[one] < FRAYED * points[other]]] = True
    pairs = pairs[~frayed[pairs].any(axis=1)]
    inner = np.bincount(pairs.ravel(), minlength=len(cells)) + 1 >= INNER
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


def _near_box_of(a: Cells, b: Cells) -> Cells:
    """The cells of ``a`` in reach of the bounding box of ``b``."""
    return a[((a >= b.min(axis=0) - REACH) & (a <= b.max(axis=0) + REACH)).all(axis=1)]


def keys(cells: NDArray) -> NDArray[np.int64]:
    """(K,) int64 keys of (K, 3) cells with indices below ``HALF``; keys sort as the indices do."""
    i, j, k = (cells.astype(np.int64) + kernels.HALF).T
    return ((i << kernels.BITS) | j) << kernels.BITS | k


def from_keys(packed: NDArray[np.int64]) -> Cells:
    """(K, 3) cells of (K,) keys, the inverse of :func:`keys`."""
    mask = (1 << kernels.BITS) - 1
    indices = np.stack([packed >> 2 * kernels.BITS, packed >> kernels.BITS & mask, packed & mask], axis=1)
    return (indices - kernels.HALF).astype(np.int32)
