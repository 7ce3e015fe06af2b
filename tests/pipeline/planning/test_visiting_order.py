"""The visiting order of several places, compared with all orders."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.planning.visiting_order import visiting_order


def costs(points) -> np.ndarray:
    points = np.array(points, float)
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


def total(cost, order) -> float:
    return float(sum(cost[a, b] for a, b in zip([0, *order], order, strict=False)))


def test_places_in_a_row_come_in_their_order():
    assert visiting_order(costs([(0, 0), (3, 0), (1, 0), (2, 0)])) == [2, 3, 1]


def test_none_and_one():
    assert visiting_order(np.zeros((1, 1))) == []
    assert visiting_order(costs([(0, 0), (1, 0)])) == [1]


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50)), min_size=2, max_size=7))
def test_few_places_come_in_the_best_order(points):
    cost = costs(points)
    best = min(total(cost, order) for order in permutations(range(1, len(points))))
    assert total(cost, visiting_order(cost)) == pytest.approx(best)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50)), min_size=12, max_size=16, unique=True))
def test_many_places_come_once_each_and_no_reversal_is_better(points):
    cost = costs(points)
    order = visiting_order(cost)
    assert sorted(order) == list(range(1, len(points)))
    for i in range(len(order)):
        for j in range(i + 1, len(order)):
            other = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
            assert total(cost, order) <= total(cost, other) + 1e-6


def test_two_opt_comes_near_the_best():
    rng = np.random.default_rng(0)
    ratios = []
    for _ in range(20):
        cost = costs(rng.uniform(0, 10, (8, 2)))
        exact = total(cost, visiting_order(cost))
        ratios.append(total(cost, visiting_order(cost, max_exact=0)) / exact)
    assert min(ratios) >= 1 - 1e-9
    assert np.mean(ratios) < 1.1
