"""Few views that show enough, and how few at least."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.optimize import linprog

from sarsim.scoring.view_tours import Leg, ViewTours, cells_shown, greedy_cover


def cover_of(rows, required_count=None, shown=()):
    views = sparse.csr_array(np.array(rows, np.bool_))
    known = np.isin(np.arange(views.shape[1]), shown)
    return greedy_cover(views, views.shape[1] if required_count is None else required_count, known)


def test_few_views_are_chosen():
    assert cover_of([[1, 1, 1, 0, 0], [0, 1, 0, 0, 0], [0, 0, 0, 1, 1]]) == [0, 2]
    assert cover_of([[1, 1, 1, 0, 0], [0, 0, 0, 1, 1]], shown=[3, 4]) == [0]
    assert cover_of([[1, 1]], shown=[0, 1]) == []
    assert cover_of([[1, 1, 1, 0, 0], [0, 0, 0, 1, 1]], required_count=3) == [0]
    assert cover_of([[1, 0], [1, 0]]) == [0]  # no view shows the second cell
    assert len(cover_of([[1, 1, 0], [0, 1, 1], [1, 0, 1]])) == 2


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_the_cover_sees_all_that_any_view_sees_with_hardly_more_views_than_are_needed(seed):
    views = sparse.csr_array(np.random.default_rng(seed).random((8, 12)) < 0.25)
    seen_by_any = np.zeros(12, np.bool_)
    seen_by_any[views.indices] = True
    order = greedy_cover(views, int(seen_by_any.sum()), np.zeros(12, np.bool_))
    seen = np.zeros(12, np.bool_)
    for view in order:
        seen[cells_shown(views, view)] = True
    assert (seen == seen_by_any).all()
    assert len(set(order)) == len(order)
    # greedy choices exceed the linear relaxation by at most the harmonic series (Chvátal 1979)
    shows = views.toarray()[:, seen_by_any].T
    bound = linprog(np.ones(8), A_ub=-shows.astype(float), b_ub=-np.ones(len(shows)), bounds=(0, 1)).fun
    most = shows.sum(axis=0).max(initial=1)
    assert bound - 1e-6 <= len(order) <= bound * sum(1 / k for k in range(1, most + 1)) + 1e-6


class Places(ViewTours):
    """Viewpoints on a line, with a drive of 1 s per metre; the robot starts at the first."""

    required_count = 4

    def __init__(self, places, rows):
        self.places, self.shown = np.array(places, float), np.array(rows, np.bool_)

    @property
    def views(self):
        return sparse.csr_array(self.shown)

    @property
    def seen_at_start(self):
        return self.shown[0]

    def seconds(self, here, there=slice(None)):
        return abs(self.places[there] - self.places[here])

    def leg(self, here, there):
        metres = abs(self.places[there] - self.places[here])
        return Leg(metres, metres, self.shown[there])


def test_a_viewpoint_that_takes_no_time_is_chosen_only_if_it_shows_more():
    shown = [[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]
    assert Places([0, 0, 0, 1, 3], shown).by_rate() == [2, 3, 4]
