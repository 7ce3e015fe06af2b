"""Sets of 5 cm cells of the map: where a surface really is inside its bounding box.

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
"""m, of the grid against the map's axes: floors and walls tend to stand at round numbers, on the cells' faces."""
REACH = 2
"""Cells up to this far apart along every axis are neighbours: gaps of 0.15 m always part, gaps of 0.05 m never."""
INNER = 20
"""Cells in reach, itself included, of a cell inside a surface: 25, or 20 beside those along an edge (15)."""
CONTACT = 12
"""Cells in reach of another set, or three quarters of all, for both to be one surface; corners meet in 9 at most."""
FRAYED = 0.25
"""A cell with less than this share of the points of another one in reach is noise at the surface's edge."""
NONE = -1  # No piece

Cells = NDArray[np.int32]


def cells_of(points: NDArray) -> tuple[Cells, NDArray[np.intp]]:
    """The (K, 3) cells that hold (N, 3) points in m, and the (N,) row of each point's cell."""
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
    """Whether two sets meet on a front, not just at a corner."""
    small, large = (a, b) if len(a) < len(b) else (b, a)
    near = _near_box_of(small, large), _near_box_of(large, small)
    if not len(near[0]) or not len(near[1]):
        return False
    distances, _ = KDTree(near[1]).query(near[0], p=np.inf, distance_upper_bound=REACH + 0.5)
    return bool(np.isfinite(distances).sum() >= min(CONTACT, 0.75 * len(small)))


def connected_pieces(cells: Cells, points: NDArray[np.intp]) -> NDArray[np.intp]:
    """(K,) number of the piece that each cell belongs to, NONE for cells that are but noise at a surface's edge.

    Noise are cells with few ``points`` (K,) beside such with many. Of the others, inner cells in reach of each other
    are of one piece, and the rest goes with the nearest of them, as in DBSCAN (Ester et al. 1996) and a watershed: so
    surfaces that touch at corners or by a thin strip stay two.
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
    """Spread pieces step by step to the cells without one, in place; of several the first wins."""
    both_ways = np.vstack([pairs, pairs[:, ::-1]])
    while True:
        source, target = both_ways[(piece[both_ways] == NONE) @ [1, 2] == 2].T
        if not len(target):
            return
        reached = np.full(len(piece), len(piece))
        np.minimum.at(reached, target, piece[source])
        piece[target] = reached[target]


def _near_box_of(a: Cells, b: Cells) -> Cells:
    """Those of ``a`` in reach of the smallest box around ``b``."""
    return a[((a >= b.min(axis=0) - REACH) & (a <= b.max(axis=0) + REACH)).all(axis=1)]


def keys(cells: NDArray) -> NDArray[np.int64]:
    """(K,) int64, a number for each of (K, 3) cells of indices below ``HALF``; they sort as the indices do."""
    i, j, k = (cells.astype(np.int64) + kernels.HALF).T
    return ((i << kernels.BITS) | j) << kernels.BITS | k


def from_keys(packed: NDArray[np.int64]) -> Cells:
    """(K, 3) cells of (K,) :func:`keys`."""
    mask = (1 << kernels.BITS) - 1
    indices = np.stack([packed >> 2 * kernels.BITS, packed >> kernels.BITS & mask, packed & mask], axis=1)
    return (indices - kernels.HALF).astype(np.int32)
