"""Both scores, computed again by hand."""

import pytest

from pipeline.plugins.league.brief import Penalties, Rewards
from sarsim.plugins.league.leagues import LeagueRun, VirtualRun, league_score, virtual_score

RUN = LeagueRun(coverage=0.8, global_error=0.25, extras=3, present=8, right=6, wrong=2, localisation_error=0.2)
VIRTUAL = VirtualRun(
    portals=8, discovered=6, victims=5, right=3, wrong=2, living=4, right_living=2, wrong_living=1, contacts=1
)


def test_the_labyrinth():
    score = league_score(RUN, Rewards(), Penalties())
    assert score["map"]["points"] == pytest.approx(0.8 / 1.25 * 1.3)
    assert score["detections"]["points"] == pytest.approx(6 / 1.2)
    assert score["autonomy"]["points"] == pytest.approx(4 * (0.832 + 5))
    assert score["resets"] == {"count": 0, "points": 0}
    assert score["total"]["points"] == pytest.approx(5 * (0.832 + 5))


def test_who_drives_and_resets_count():
    run = LeagueRun(0.8, 0.25, 3, 8, 6, 2, 0.2, is_autonomous=False, resets=2)
    score = league_score(run, Rewards(), Penalties(reset=0.5))
    assert score["total"]["points"] == pytest.approx(0.832 + 5 - 1)


def test_the_virtual_competition():
    score = virtual_score(VIRTUAL, Rewards(beta=0.4, alpha=1.5), Penalties())
    assert score["portals"]["points"] == pytest.approx(1.5 * 0.4 * 6 / 8)
    assert score["victims"]["points"] == pytest.approx(1.5 * 0.6 * (3 - 0.5 * 2) / 5)
    assert score["living"]["points"] == pytest.approx(1.5 * 0.6 * (2 * 2 - 1) / (2 * 4))
    assert score["contacts"]["points"] == pytest.approx(-0.2 * 1.5 * 0.6 * (1 / 5 + 1 / 4))
    assert score["total"]["points"] == pytest.approx(0.45 + 0.36 + 0.3375 - 0.081)


def test_wrong_marks_of_the_living_cost_at_most_what_the_living_bring():
    run = VirtualRun(8, 6, 5, 3, 2, living=4, right_living=0, wrong_living=9)
    assert virtual_score(run, Rewards(), Penalties())["living"]["points"] == 0


def test_contacts_cost_at_most_what_the_living_bring():
    run = VirtualRun(8, 6, 5, 3, 2, living=4, right_living=2, wrong_living=1, contacts=1000)
    assert virtual_score(run, Rewards(), Penalties())["contacts"]["points"] == pytest.approx(
        -2 * 0.5 * (1 / 5 + 1 / 4)
    )


def test_without_victims_or_portals_there_are_no_points():
    run = VirtualRun(0, 0, 0, 0, 3, living=0, right_living=0, wrong_living=2, contacts=1)
    assert virtual_score(run, Rewards(), Penalties())["total"]["points"] == 0
