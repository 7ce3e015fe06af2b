"""Sets of small grid cells, which show where in its bounding box a surface lies.

A set holds distinct cell indices, sorted. The grid belongs to the map, not to a surface, so the union of sets from
different frames is exact and does not depend on their order. Cell centres lie at multiples of the edge length,
because floors and walls tend to lie there, too; on the face between two cells, noise would spread a surface over
both.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from pipeline.arrays import Indices, Places
from pipeline.geometry import cells_kernels as kernels
from pipeline.geometry.voxel_hash import voxels_of
from pipeline.geometry.voxel_hash_kernels import unpacked

NONE = -1
"""Piece number of a cell that belongs to no piece."""
REACH = 2
"""Maximum distance between neighbouring cells along every axis, cells.

With 2 and cells of 0.05 m, gaps of 0.15 m always divide a surface, and gaps of 0.05 m never do.
"""
MIN_FRONT_CELLS = (REACH + 1) ** 2 + 1
"""Minimum number of a set's cells near another set for both to form one surface: one more than at a corner."""
MIN_POINT_RATIO = 0.25
"""Minimum number of points in a cell, as a fraction of a neighbour's; a cell with fewer is noise at the surface's
edge."""
SurfaceCells: TypeAlias = NDArray[np.int32]
"""(K, 3) int32 distinct indices of cells, sorted."""


def cells_of(points: NDArray[np.floating], edge: float) -> tuple[SurfaceCells, Indices]:
    """The (K, 3) cells of ``edge`` m that contain points (N, 3), m, and the (N,) row of each point's cell."""
    row, keys = voxels_of(np.asarray(points, np.float32) + np.float32(edge / 2), 1 / edge)
    return unpacked(keys), row


def centres(cells: SurfaceCells, edge: float) -> Places:
    """(K, 3) m, the centres of cells (K, 3) of edge length ``edge``, m."""
    return np.multiply(cells, edge, dtype=np.float64)


def unite(a: SurfaceCells, b: SurfaceCells) -> SurfaceCells:
    """The union (M, 3) of two sets (K, 3) and (L, 3)."""
    return kernels.united(a, b)


def in_contact(a: SurfaceCells, b: SurfaceCells) -> bool:
    """Whether two sets (K, 3) and (L, 3) meet along a front, not only at a corner."""
    small, large = (a, b) if len(a) < len(b) else (b, a)
    return kernels.count_near(small, large, REACH, MIN_FRONT_CELLS) >= MIN_FRONT_CELLS


def connected_pieces(cells: SurfaceCells, points: Indices) -> Indices:
    """(K,) number of the piece to which each cell belongs; NONE for cells that are only noise at a surface's edge.

    Cells with few ``points`` (K,) next to cells with many points are noise. Among the others, neighbouring inner
    cells form one piece, and each remaining cell joins the nearest piece, as in DBSCAN (Ester et al. 1996) and
    watersheds. Thus surfaces that touch only at corners or along a thin strip stay separate. An inner cell of a level
    or upright surface lacks at most one row of its square of neighbours.
    """
    side = 2 * REACH + 1
    pairs = KDTree(cells).query_pairs(REACH, p=np.inf, output_type="ndarray")
    frayed = np.zeros(len(cells), bool)
    for one, other in (pairs.T, pairs.T[::-1]):
        frayed[one[points[one] < MIN_POINT_RATIO * points[other]]] = True
    pairs = pairs[~frayed[pairs].any(axis=1)]
    inner = np.bincount(pairs.ravel(), minlength=len(cells)) + 1 >= side * (side - 1)
    piece = np.where(inner, _components(pairs[inner[pairs].all(axis=1)], len(cells)), NONE)
    _flood(piece, pairs)
    apart = _components(pairs[(piece[pairs] == NONE).all(axis=1)], len(cells)) + len(cells)
    return np.where(frayed, NONE, np.where(piece == NONE, apart, piece))


def _components(pairs: NDArray[np.intp], size: int) -> Indices:
    """(``size``,) number of the connected component of each cell, given the (P, 2) pairs of neighbouring cells."""
    graph = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(size, size))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _flood(piece: Indices, pairs: NDArray[np.intp]) -> None:
    """Spread the numbers ``piece`` (K,) in place, step by step, over ``pairs`` (P, 2) to neighbours without a number.

    Where several pieces meet, the lowest number wins.
    """
    both_ways = np.vstack([pairs, pairs[:, ::-1]])
    while True:
        source, target = both_ways[(piece[both_ways] == NONE) @ [1, 2] == 2].T
        if not len(target):
            return
        reached = np.full(len(piece), len(piece))
        np.minimum.at(reached, target, piece[source])
        piece[target] = reached[target]
