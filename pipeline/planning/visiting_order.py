"""The order in which to visit several positions."""

from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray


def visiting_order(cost: NDArray[np.float64], max_exact: int = 7) -> list[int]:
    """A cheap order in which to visit positions 1 … N - 1, starting at position 0 and ending at any of them.

    Args:
        cost: (N, N) finite cost of the path from each position to each other position, m or s.
        max_exact: maximum number of positions to visit for which the order is optimal; for more positions, the order
            is one that 2-opt cannot improve.
    """

    def total(order: list[int]) -> float:
        return float(cost[[0, *order[:-1]], order].sum())

    # With few positions, choose the cheapest of all orders.
    if len(cost) - 1 <= max_exact:
        ways = np.array([(0, *order) for order in permutations(range(1, len(cost)))])
        best: NDArray[np.int64] = ways[cost[ways[:, :-1], ways[:, 1:]].sum(axis=1).argmin(), 1:]
        return best.tolist()
    # With many positions, begin with the order that always visits the nearest position next. Then reverse parts of
    # the order as long as this makes the order cheaper.
    left = set(range(1, len(cost)))
    order: list[int] = []
    while left:
        here = order[-1] if order else 0
        order.append(min(left, key=lambda k: (cost[here, k], k)))
        left.remove(order[-1])
    improved = True
    while improved:
        improved = False
        for i, j in combinations(range(len(order)), 2):
            other = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
            if total(other) < total(order) * (1 - np.finfo(np.float64).eps):
                order = other
                improved = True
    return order
