"""The order in which to visit several positions."""

from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray


def visiting_order(cost: NDArray[np.float64], exact: int = 7) -> list[int]:
    """A cheap order in which to visit positions 1 … N - 1, starting at position 0 and ending at any of them.

    Args:
        cost: (N, N) finite cost of the path from each position to each other one, m or s.
        exact: maximum number of positions for which the order is optimal; for more, 2-opt cannot improve it.
    """
    if len(cost) - 1 <= exact:
        return _best_order(cost)
    return _two_opt(cost, _nearest_first(cost))


def _best_order(cost: NDArray[np.float64]) -> list[int]:
    """The cheapest of all orders."""
    ways = np.array([(0, *order) for order in permutations(range(1, len(cost)))])
    best: NDArray[np.int64] = ways[cost[ways[:, :-1], ways[:, 1:]].sum(axis=1).argmin(), 1:]
    return best.tolist()


def _nearest_first(cost: NDArray[np.float64]) -> list[int]:
    left, order, here = set(range(1, len(cost))), [], 0
    while left:
        here = min(left, key=lambda k: (cost[here, k], k))
        left.remove(here)
        order.append(here)
    return order


def _two_opt(cost: NDArray[np.float64], order: list[int]) -> list[int]:
    """Reverse parts of the order as long as this makes it cheaper."""
    improved = True
    while improved:
        improved = False
        for i, j in combinations(range(len(order)), 2):
            other = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
            if _total(cost, other) < _total(cost, order) * (1 - np.finfo(np.float64).eps):
                order, improved = other, True
    return order


def _total(cost: NDArray[np.float64], order: list[int]) -> float:
    return float(cost[[0, *order[:-1]], order].sum())
