import numpy as np
import pytest

from pipeline.exploration.posterior import MOST_MISSES, Posterior


def test_by_laplaces_rule_what_was_missed_k_times_shows_in_one_of_k_plus_1_tries():
    np.testing.assert_allclose(Posterior(10).chances, 1 / (1 + np.arange(MOST_MISSES + 1)))


def test_tries_of_the_mission_come_to_those_of_the_prior():
    posterior = Posterior(10)
    posterior.shown[1], posterior.missed[1] = 20, 30  # two and three tries
    _, once, twice, *_ = posterior.chances
    assert once == pytest.approx((1 + 2) / (2 + 2 + 3))
    assert twice == pytest.approx(2 / 3 * once)  # of these there is nothing but the prior


def test_what_was_never_missed_stays_certain():
    posterior = Posterior(10)
    posterior.missed[0] = 10**6
    assert posterior.chances[0] == 1


def test_what_shows_at_the_second_try_may_be_likelier_than_what_was_missed_once():
    posterior = Posterior(10)
    posterior.missed[1] = posterior.shown[2] = 1000
    assert posterior.chances[1] < 0.02 < 0.95 < posterior.chances[2]
