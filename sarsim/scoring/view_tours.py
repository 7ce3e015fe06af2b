"""Tours over viewpoints that see enough: by set cover or by rate, in a short order, without needless stops."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf

import numpy as np
from scipy import sparse

from pipeline.arrays import Mask, Values
from pipeline.planning.visiting_order import visiting_order
from sarsim.scoring.set_cover import cover_bound, greedy_cover


@dataclass(frozen=True, eq=False)
class Tour:
    """A drive that sees enough.

    Attributes:
        order: of the viewpoints, by their numbers.
        seconds, metres: until enough was seen; inf if it never was.
    """

    order: list[int]
    seconds: float
    metres: float


@dataclass(frozen=True, eq=False)
class Leg:
    """A drive from one viewpoint to the next.

    Attributes:
        seconds, metres: of the drive, with the keyframe at its end.
        seen: cells that its keyframes show.
    """

    seconds: float
    metres: float
    seen: Mask


class ViewTours(ABC):
    """Looks for the quickest tour over viewpoints, whose first is the start, that sees enough cells."""

    @property
    @abstractmethod
    def views(self) -> sparse.csr_array:
        """(V, N) bool sparse, the cells that each viewpoint shows."""

    @property
    @abstractmethod
    def wanted(self) -> int:
        """Number of cells that are to be seen."""

    @property
    @abstractmethod
    def at_start(self) -> Mask:
        """The cells seen at once."""

    @abstractmethod
    def seconds(self, here: int, there: Sequence[int] | slice = slice(None)) -> Values:
        """Seconds from one viewpoint to others, more than 0."""

    @abstractmethod
    def leg(self, here: int, there: int) -> Leg:
        """The drive between two viewpoints, and what it shows."""

    def tour(self, order: Sequence[int]) -> Tour:
        """The tour over viewpoints, up to the one where enough was seen."""
        seen, seconds, metres, done = self.at_start, 0.0, 0.0, list[int]()
        for here, there in pairwise([0, *order]):
            if seen.sum() >= self.wanted:
                break
            leg = self.leg(here, there)
            seen, seconds, metres = seen | leg.seen, seconds + leg.seconds, metres + leg.metres
            done.append(there)
        return Tour(done, *((seconds, metres) if seen.sum() >= self.wanted else (inf, inf)))

    def cover(self) -> list[int]:
        """Few viewpoints that see enough."""
        return greedy_cover(self.views, self.wanted, self.at_start)

    def bound(self) -> float:
        """No fewer viewpoints than this cover enough, by the relaxed set cover."""
        return cover_bound(self.views, self.wanted, self.at_start)

    def by_rate(self) -> list[int]:
        """Viewpoints that see enough, each the one that shows most new ground a second from the one before it."""
        seen, order = self.at_start.copy(), list[int]()
        while seen.sum() < self.wanted:
            rate = (self.views @ (~seen).astype(np.float64)) / self.seconds(order[-1] if order else 0)
            best = int(rate.argmax())
            if rate[best] <= 0:
                break
            order.append(best)
            seen |= self.leg(order[-2] if len(order) > 1 else 0, best).seen
        return order

    def ordered(self, views: list[int]) -> list[int]:
        """The viewpoints in an order that makes the drive over all of them short, no longer than as given."""
        cost = np.array([self.seconds(a, [0, *views]) for a in [0, *views]])
        order = [views[k - 1] for k in visiting_order(cost)]
        return min(order, views, key=lambda way: sum(self.seconds(a, [b])[0] for a, b in pairwise([0, *way])))

    @cached_property
    def quickest(self) -> Tour:
        """The quickest of the shortened tours over the cover and over the viewpoints by their rate."""
        orders = [order for views in (self.cover(), self.by_rate()) for order in (views, self.ordered(views))]
        return min((self.shortened(self.tour(order)) for order in orders), key=lambda tour: tour.seconds)

    def shortened(self, tour: Tour) -> Tour:
        """Leave out one viewpoint after another, each time the one without which the tour is quickest."""
        while True:
            others = [self.tour(tour.order[:k] + tour.order[k + 1 :]) for k in range(len(tour.order))]
            quickest = min(others, key=lambda other: other.seconds, default=tour)
            if not quickest.seconds < tour.seconds:
                return tour
            tour = quickest
