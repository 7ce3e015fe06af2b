"""Tours on which enough is seen: viewpoints chosen by set cover or rate, in a short order, without needless stops."""

import heapq
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pipeline.arrays import Mask, Values
from pipeline.planning.visiting_order import visiting_order


@dataclass(frozen=True, eq=False)
class Tour:
    """A drive over viewpoints on which enough is seen.

    Attributes:
        order: indices of the viewpoints in the order of the tour.
        seconds, metres: time and path length until enough has been seen; inf if that never happens.
    """

    order: list[int]
    seconds: float
    metres: float


@dataclass(frozen=True, eq=False)
class Leg:
    """A drive from one viewpoint to the next.

    Attributes:
        seconds, metres: duration and length of the drive; its keyframes take no time, as in the simulation.
        seen_cells: (N,) bool, cells that the keyframes of the drive show.
    """

    seconds: float
    metres: float
    seen_cells: Mask

    @cached_property
    def bits(self) -> NDArray[np.uint8]:
        """The seen cells, packed eight per byte, so that several legs are combined and their cells counted faster."""
        return np.packbits(self.seen_cells)


class ViewTours(ABC):
    """Searches for the fastest tour on which enough cells are seen; the first viewpoint is the start."""

    @property
    @abstractmethod
    def views(self) -> sparse.csr_array:
        """(V, N) bool, sparse, the cells that are seen from each viewpoint."""

    @property
    @abstractmethod
    def required_count(self) -> int:
        """Number of cells that must be seen."""

    @property
    @abstractmethod
    def seen_at_start(self) -> Mask:
        """(N,) bool, the cells seen from the start."""

    @abstractmethod
    def seconds(self, here: int, there: Sequence[int] | slice = slice(None)) -> Values:
        """(M,) s, driving time from one viewpoint to each of the others."""

    @abstractmethod
    def leg(self, here: int, there: int) -> Leg:
        """The drive between two viewpoints, with the cells that are seen on it."""

    def tour(self, order: Sequence[int]) -> Tour:
        """The tour over viewpoints in a given order, up to the viewpoint at which enough has been seen."""
        seen, seconds, metres, done = np.packbits(self.seen_at_start), 0.0, 0.0, list[int]()
        for here, there in pairwise([0, *order]):
            if np.bitwise_count(seen).sum() >= self.required_count:
                break
            leg = self.leg(here, there)
            seen, seconds, metres = seen | leg.bits, seconds + leg.seconds, metres + leg.metres
            done.append(there)
        return Tour(done, *((seconds, metres) if np.bitwise_count(seen).sum() >= self.required_count else (inf, inf)))

    def cover(self) -> list[int]:
        """A small set of viewpoints from which enough is seen."""
        return greedy_cover(self.views, self.required_count, self.seen_at_start)

    def by_rate(self) -> list[int]:
        """Viewpoints from which enough is seen; each shows the most new ground per second of the drive to it."""
        seen, order = self.seen_at_start.copy(), list[int]()
        while seen.sum() < self.required_count:
            # A viewpoint in the cell of the last one takes no time if the two have almost the same heading.
            seconds = np.maximum(self.seconds(order[-1] if order else 0), np.finfo(np.float64).eps)
            rate = (self.views @ (~seen).astype(np.float64)) / seconds
            best = int(rate.argmax())
            if rate[best] <= 0:
                break
            order.append(best)
            seen |= self.leg(order[-2] if len(order) > 1 else 0, best).seen_cells
        return order

    def ordered(self, views: list[int]) -> list[int]:
        """The viewpoints in an order that makes the drive over all of them short, no longer than the given order."""
        cost = np.array([self.seconds(a, [0, *views]) for a in [0, *views]])
        orders = visiting_order(cost), range(1, len(views) + 1)
        order = min(orders, key=lambda order: sum(cost[a, b] for a, b in pairwise([0, *order])))
        return [views[k - 1] for k in order]

    @cached_property
    def fastest(self) -> Tour:
        """The fastest shortened tour, over the viewpoints of the set cover or over those chosen by rate."""
        orders = [order for views in (self.cover(), self.by_rate()) for order in (views, self.ordered(views))]
        return min((self.shortened(self.tour(order)) for order in orders), key=lambda tour: tour.seconds)

    def shortened(self, tour: Tour) -> Tour:
        """Leave out viewpoints one by one, always the one that saves the most time, until no omission saves time."""
        while True:
            others = [self.tour(tour.order[:k] + tour.order[k + 1 :]) for k in range(len(tour.order))]
            fastest = min(others, key=lambda other: other.seconds, default=tour)
            if not fastest.seconds < tour.seconds:
                return tour
            tour = fastest


def greedy_cover(views: sparse.csr_array, required_count: int, shown: Mask) -> list[int]:
    """Views that together show ``required_count`` cells; each adds the most cells to the earlier ones.

    Gains are evaluated lazily, because they never grow (Minoux 1978). If all views together show fewer cells, so does
    the result.

    Args:
        views: (V, N), nonzero where a view shows a cell.
        required_count: number of cells to show, including those already shown.
        shown: (N,) bool, the cells that are already shown; not changed.
    """
    shown, chosen = shown.copy(), list[int]()
    heap = [(-int(count), view) for view, count in enumerate(np.diff(views.indptr))]
    heapq.heapify(heap)
    while heap and shown.sum() < required_count:
        _, view = heapq.heappop(heap)
        gain = int(np.count_nonzero(~shown[cells_shown(views, view)]))
        if gain and heap and gain < -heap[0][0]:
            heapq.heappush(heap, (-gain, view))
        elif gain:
            chosen.append(view)
            shown[cells_shown(views, view)] = True
    return chosen


def cells_shown(views: sparse.csr_array, view: int) -> NDArray[np.int32]:
    """(M,) indices of the cells that one of the (V, N) views shows."""
    cells: NDArray[np.int32] = views.indices[views.indptr[view] : views.indptr[view + 1]]
    return cells
