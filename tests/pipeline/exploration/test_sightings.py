import numpy as np
import pytest

from pipeline.exploration.sightings import visibility_probabilities

NONE = np.zeros(256)


def test_by_laplaces_rule_what_was_missed_k_times_shows_in_one_of_k_plus_1_tries():
    np.testing.assert_allclose(visibility_probabilities(NONE, NONE), 1 / (1 + np.arange(256)))


def test_tries_of_the_run_come_to_those_of_the_prior():
    shown, missed = NONE.copy(), NONE.copy()
    shown[1], missed[1] = 2, 3
    _, once, twice, *_ = visibility_probabilities(shown, missed)
    assert once == pytest.approx((1 + 2) / (2 + 2 + 3))
    assert twice == pytest.approx(2 / 3 * once)  # of these there is nothing but the prior


def test_what_was_never_missed_stays_certain():
    missed = NONE.copy()
    missed[0] = 10**5
    assert visibility_probabilities(NONE, missed)[0] == 1


def test_what_shows_at_the_second_try_may_be_likelier_than_what_was_missed_once():
    shown, missed = NONE.copy(), NONE.copy()
    missed[1] = shown[2] = 100
    _, once, twice, *_ = visibility_probabilities(shown, missed)
    assert once < 0.02 < 0.95 < twice
