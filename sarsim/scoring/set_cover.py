"""Set cover: a small set of views that together show enough, and a lower bound on its size."""

import heapq

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog

from pipeline.arrays import Mask


def greedy_cover(views: sparse.csr_array, wanted: int, shown: Mask) -> list[int]:
    """Views that together show ``wanted`` cells; each is the one that adds the most cells to those before it.

    Evaluated lazily, because gains never grow (Minoux 1978). If all views together show fewer, so does the result.

    Args:
        views: (V, N), nonzero where a view shows a cell.
        wanted: number of cells to show, including those already shown.
        shown: which cells are shown already; not changed.
    """
    shown, chosen = shown.copy(), list[int]()
    heap = [(-int(count), view) for view, count in enumerate(np.diff(views.indptr))]
    heapq.heapify(heap)
    while heap and shown.sum() < wanted:
        _, view = heapq.heappop(heap)
        gain = int(np.count_nonzero(~shown[cells_shown(views, view)]))
        if gain and heap and gain < -heap[0][0]:
            heapq.heappush(heap, (-gain, view))
        elif gain:
            chosen.append(view)
            shown[cells_shown(views, view)] = True
    return chosen


def cover_bound(views: sparse.csr_array, wanted: int, shown: NDArray[np.bool_]) -> float:
    """Lower bound on the number of views that show ``wanted`` cells, by linear relaxation of the partial set cover.

    The minimum of Σ x over x, y in [0, 1] with y_c ≤ Σ x of the views that show c, and Σ y = ``wanted``. Infinite
    if all views together show fewer. Arguments as for :func:`greedy_cover`: (V, N) views and the (N,) cells shown.
    """
    rest = np.flatnonzero(~shown)
    missing = wanted - int(shown.sum())
    if missing <= 0:
        return 0.0
    # Cells that the same views show are merged into one, weighted by their number.
    columns, count = _distinct_columns(views[:, rest])
    v, n = columns.shape
    cost = np.concatenate([np.ones(v), np.zeros(n)])
    is_shown = sparse.hstack([-columns.T.astype(np.float64), sparse.eye_array(n)]).tocsr()
    total = np.concatenate([np.zeros(v), count])[None]
    found = linprog(cost, A_ub=is_shown, b_ub=np.zeros(n), A_eq=total, b_eq=[missing], bounds=(0, 1), method="highs")
    return float(found.fun) if found.success else float("inf")


def cells_shown(views: sparse.csr_array, view: int) -> NDArray[np.int32]:
    """(M,) the cells that one of (V, N) views shows."""
    cells: NDArray[np.int32] = views.indices[views.indptr[view] : views.indptr[view + 1]]
    return cells


def _distinct_columns(views: sparse.csr_array) -> tuple[sparse.csc_array, NDArray[np.int64]]:
    """The distinct columns of a matrix (V, N), and how often each occurs."""
    columns = sparse.csc_array(views)
    columns.sort_indices()
    first, count = dict[bytes, int](), np.zeros(columns.shape[1], np.int64)
    for c in range(columns.shape[1]):
        key = columns.indices[columns.indptr[c] : columns.indptr[c + 1]].tobytes()
        count[first.setdefault(key, c)] += 1
    kept = np.flatnonzero(count)
    return columns[:, kept], count[kept]
