"""Few views that show enough, and how few at least."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from sarsim.scoring.set_cover import cells_shown, cover_bound, greedy_cover


def cover_of(rows, wanted=None, shown=()):
    views = sparse.csr_array(np.array(rows, np.bool_))
    known = np.isin(np.arange(views.shape[1]), shown)
    wanted = views.shape[1] if wanted is None else wanted
    return greedy_cover(views, wanted, known), cover_bound(views, wanted, known)


def test_of_two_rooms_each_needs_a_view_and_the_bound_is_tight():
    assert cover_of([[1, 1, 1, 0, 0], [0, 1, 0, 0, 0], [0, 0, 0, 1, 1]]) == ([0, 2], 2.0)


def test_cells_that_are_shown_already_need_no_view():
    assert cover_of([[1, 1, 1, 0, 0], [0, 0, 0, 1, 1]], shown=[3, 4]) == ([0], 1.0)
    assert cover_of([[1, 1]], shown=[0, 1]) == ([], 0.0)


def test_a_part_of_the_cells_needs_part_of_the_views():
    assert cover_of([[1, 1, 1, 0, 0], [0, 0, 0, 1, 1]], wanted=3) == ([0], 1.0)


def test_the_relaxation_of_a_triangle_is_one_and_a_half():
    order, bound = cover_of([[1, 1, 0], [0, 1, 1], [1, 0, 1]])
    assert len(order) == 2
    assert np.isclose(bound, 1.5)


def test_what_no_view_shows_is_never_covered():
    order, bound = cover_of([[1, 0], [1, 0]])
    assert order == [0]
    assert bound == np.inf


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_the_cover_sees_all_that_any_view_sees_and_is_no_smaller_than_the_bound(seed):
    views = sparse.csr_array(np.random.default_rng(seed).random((8, 12)) < 0.25)
    seen_by_any = np.zeros(12, np.bool_)
    seen_by_any[views.indices] = True
    wanted, none = int(seen_by_any.sum()), np.zeros(12, np.bool_)
    order = greedy_cover(views, wanted, none)
    seen = np.zeros(12, np.bool_)
    for view in order:
        seen[cells_shown(views, view)] = True
    assert (seen == seen_by_any).all()
    assert len(set(order)) == len(order)
    assert cover_bound(views, wanted, none) <= len(order) + 1e-6
