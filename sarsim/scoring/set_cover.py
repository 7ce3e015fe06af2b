"""Set cover: a small set of views that together show enough."""

import heapq

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

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


def cells_shown(views: sparse.csr_array, view: int) -> NDArray[np.int32]:
    """(M,) the cells that one of (V, N) views shows."""
    cells: NDArray[np.int32] = views.indices[views.indptr[view] : views.indptr[view + 1]]
    return cells
