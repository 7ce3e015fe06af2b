"""Sets of 5 cm cells of the map: where a surface really is inside its bounding box.

A set is a (K, 3) int32 array of distinct indices, sorted. The cells are the map's, not the surface's, so sets of
different looks unite exactly and in any order.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

CELL = 0.05
"""m, the edge of a cell."""
SHIFT = 0.02
"""m, of the grid against the map's axes: floors and walls tend to stand at round numbers, on the cells' faces."""
REACH = 2
"""Cells up to this far apart along every axis are neighbours: gaps of 0.15 m always part, gaps of 0.05 m never."""
CORE = 12
"""Cells in reach, itself included, inside a surface or along an edge (25 and 15); in a corner there are 9."""
CONTACT = 12
"""Cells in reach of another set, or three quarters of all, for both to be one surface; corners meet in 9 at most."""
FRAYED = 0.25
"""A cell with less than this share of the points of another one in reach is noise at the surface's edge."""
NONE = -1
"""No piece."""

Cells = NDArray[np.int32]

_BITS = 21
_HALF = 1 << (_BITS - 1)


def cells_of(points: NDArray) -> tuple[Cells, NDArray[np.intp]]:
    """The (K, 3) cells that hold (N, 3) points in m, and the (N,) row of each point's cell."""
    indices = np.floor((points + np.float32(SHIFT)) * np.float32(1 / CELL)).astype(np.int64)
    keys, row = np.unique(_keys(indices), return_inverse=True)
    return _from_keys(keys), row


def centres(cells: Cells) -> NDArray[np.float64]:
    """(K, 3) centres in m."""
    return cells.astype(np.float64) * CELL + (CELL / 2 - SHIFT)


def unite(a: Cells, b: Cells) -> Cells:
    """The cells of both sets."""
    return _from_keys(np.union1d(_keys(a), _keys(b)))


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

    Noise are cells with few ``points`` (K,) beside such with many. Of the others, in the manner of DBSCAN (Ester et
    al. 1996), core cells in reach of each other are of one piece, so that surfaces whose corners touch stay two.
    Cells that are no core go with a core cell in reach; those without one make pieces among themselves.
    """
    pairs = KDTree(cells).query_pairs(REACH + 0.5, p=np.inf, output_type="ndarray")
    frayed = np.zeros(len(cells), bool)
    for one, other in (pairs.T, pairs.T[::-1]):
        frayed[one[points[one] < FRAYED * points[other]]] = True
    pairs = pairs[~frayed[pairs].any(axis=1)]
    core = np.bincount(pairs.ravel(), minlength=len(cells)) + 1 >= CORE
    anchored = _anchors(pairs, core)
    alone = ~core
    alone[anchored[:, 0]] = False
    links = np.vstack([pairs[core[pairs].all(axis=1)], anchored, pairs[alone[pairs].all(axis=1)]])
    graph = coo_array((np.ones(len(links), np.int8), links.T), shape=(len(cells), len(cells)))
    return np.where(frayed, NONE, connected_components(graph, directed=False)[1])


def _anchors(pairs: NDArray[np.intp], core: NDArray[np.bool_]) -> NDArray[np.intp]:
    """(M, 2): every cell in reach of core cells but none itself, with the first of these."""
    mixed = pairs[core[pairs].sum(axis=1) == 1]
    mixed = np.where(core[mixed[:, :1]], mixed[:, ::-1], mixed)
    mixed = mixed[np.lexsort(mixed.T[::-1])]
    return mixed[np.unique(mixed[:, 0], return_index=True)[1]]


def _near_box_of(a: Cells, b: Cells) -> Cells:
    """Those of ``a`` in reach of the smallest box around ``b``."""
    return a[((a >= b.min(axis=0) - REACH) & (a <= b.max(axis=0) + REACH)).all(axis=1)]


def _keys(cells: NDArray) -> NDArray[np.int64]:
    i, j, k = (cells.astype(np.int64) + _HALF).T
    return ((i << _BITS) | j) << _BITS | k


def _from_keys(keys: NDArray[np.int64]) -> Cells:
    mask = (1 << _BITS) - 1
    return (np.stack([keys >> 2 * _BITS, keys >> _BITS & mask, keys & mask], axis=1) - _HALF).astype(np.int32)
