"""A mission's scores on the front of the page."""

import pytest

from pipeline.rescue_report.page import page
from pipeline.rescue_report.scores import league_scores
from tests.pipeline.rescue_report.html_page import read
from tests.pipeline.rescue_report.people import before_a_wall

REPORT = {
    "arena": "nist",
    "league": {
        "map": {"coverage": 0.5, "bonus": 1.3, "points": 0.65},
        "detections": {"right": 2, "wrong": 1, "points": 2.0},
        "resets": {"count": 0, "points": 0.0},
        "total": {"points": 2.65},
    },
    "virtual": {
        "portals": {"present": 3, "discovered": 1, "points": 0.25},
        "contacts": {"count": 2, "points": -0.125},
        "total": {"points": 0.125},
    },
}


def test_rules_and_losses_in_words() -> None:
    league, virtual = league_scores(REPORT)
    assert (league.points, virtual.points) == (2.65, 0.125)
    assert league.rules["map"] == "0.65: coverage 0.5, bonus 1.3"
    assert league.losses == ["50% of the ground not mapped", "detections: 1 wrong"]
    assert virtual.losses == ["portals: 2 missed", "contacts: 0.12 points"]


@pytest.mark.parametrize(
    ("rule", "figures"),
    [
        ("resets", {"count": 0, "points": 0.0}),
        ("map", {"coverage": 0.996, "points": 1.0}),
        ("detections", {"present": 5, "right": 4, "points": 4.0}),
        ("detections", {"present": 4, "right": 4, "wrong": 1, "points": 4.0}),
        ("contacts", {"count": 1, "points": -0.1}),
    ],
)
def test_a_mission_has_lost_nothing_only_if_nothing_is_missing(rule: str, figures: dict[str, float]) -> None:
    whole = {"map": {"coverage": 1.0, "points": 1.3}, "detections": {"present": 4, "right": 4, "points": 4.0}}
    report = {"arena": "a", "league": whole | {rule: figures, "total": {"points": 5.0}}}
    (score,) = league_scores(report)
    assert len(score.losses) == (rule != "resets")
    assert ("Nothing was missed" in read(page(before_a_wall(None), report)).text) == (rule == "resets")


def test_the_page_shows_the_scores_before_the_map() -> None:
    text = read(page(before_a_wall(None), REPORT)).text
    assert -1 < text.index("Rescue Robot League: 2.65 points") < text.index("detections: 1 wrong")
    assert text.index("Virtual Robot competition") < text.index("Map")


def test_without_a_mission_the_page_has_none() -> None:
    assert league_scores({"arena": "nist"}) == []
    assert "Rescue Robot League" not in read(page(before_a_wall(None), {"arena": "nist"})).text
