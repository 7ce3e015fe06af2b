import numpy as np
import pytest

from pipeline.exploration.next_best_view import NextBestView
from pipeline.exploration.sightings import visibility_probabilities
from pipeline.transforms import from_yaw
from tests.pipeline.exploration.asking import context, corridor, next_viewpoint
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import wall_points

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


def test_ground_that_turns_out_to_be_behind_a_wall_was_not_missed():
    world, pose = corridor(-2, 2, is_closed=True), from_yaw(0.5, 0, 0, 0)
    exploration = NextBestView(PIONEER)
    assert next_viewpoint(exploration, world, pose) is not None
    assert exploration.sightings.misses.any()
    assert next_viewpoint(exploration, world, pose) is not None  # and the first viewpoint has shown nothing
    world.update(wall_points((2, -1), (2, 1)))
    next_viewpoint(exploration, world, pose)
    assert not exploration.sightings.misses.any()


def test_misses_of_ground_that_was_shown_in_the_end_still_count():
    exploration, earlier, chances = NextBestView(PIONEER), np.zeros((0, 4, 4)), []
    for x, known in ((-0.6, 2), (0.0, 2), (0.6, 2), (1.2, 2), (1.2, 6)):
        here = context(corridor(-6, known), from_yaw(x, 0, 0, 0), earlier)
        exploration.observe(here)
        earlier = here.poses
        chances.append(exploration.sightings.visibility_probabilities[1])
    assert chances[-2] < 0.3 < chances[-1] < 0.9
