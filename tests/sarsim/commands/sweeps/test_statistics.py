"""Interquartile means and their intervals against small cases and independent implementations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import trim_mean

from sarsim.commands.sweeps.statistics import estimate, interquartile_mean


@given(arrays(np.float64, st.integers(1, 30), elements=st.floats(-1e6, 1e6)))
def test_a_quarter_at_either_end_is_left_out(values: np.ndarray) -> None:
    assert interquartile_mean(values) == pytest.approx(trim_mean(values, 0.25), abs=1e-6)


def test_a_few_that_never_arrive_do_not_count_and_many_do() -> None:
    assert interquartile_mean(np.array([1.0, 2.0, 4.0, np.inf])) == 3.0
    assert interquartile_mean(np.array([1.0, 2.0, np.inf, np.inf])) == np.inf


def test_equal_values_have_no_interval() -> None:
    assert estimate(np.full((5, 3), 7.0)) == (7.0, 7.0, 7.0)


def test_seeds_that_do_not_differ_change_nothing_but_the_draws() -> None:
    arenas = np.random.default_rng(1).normal(10, 2, (40, 1))
    one, three = estimate(arenas), estimate(np.repeat(arenas, 3, axis=1))
    assert three.value == pytest.approx(one.value, abs=0.2)
    assert three.high - three.low == pytest.approx(one.high - one.low, rel=0.2)


def test_an_interval_is_that_of_the_mean_of_many_arenas() -> None:
    values = np.random.default_rng(2).normal(0, 1, (400, 1))
    found = estimate(values)
    assert found.low < found.value < found.high
    assert 0.15 < found.high - found.low < 0.35  # 3.92 × 1.2 / √400: the middle half of a normal has 1.2 times the σ
    assert found == estimate(values)
