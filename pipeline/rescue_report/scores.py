"""The leagues' scores of a mission, in words."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.rescue_report.words import percent

LEAGUES = {"league": "Rescue Robot League", "virtual": "Virtual Robot competition", "small": "small league"}


@dataclass(frozen=True)
class LeagueScore:
    """The score of a mission in a league.

    Attributes:
        name: the league's name.
        points: total points.
        rules: text for each rule, with the points and the figures from which the points follow.
        losses: reasons why points were lost, or would be lost under other rules.
    """

    name: str
    points: float
    rules: dict[str, str]
    losses: list[str]


def league_scores(report: Mapping[str, Any]) -> list[LeagueScore]:
    """The scores in report.json, which need the ground truth; an empty list if no mission was scored."""
    return [
        LeagueScore(
            name,
            report[key]["total"]["points"],
            {rule: _shown(figures) for rule, figures in report[key].items() if rule != "total"},
            list(_losses(report[key])),
        )
        for key, name in LEAGUES.items()
        if key in report
    ]


def _shown(figures: Mapping[str, float]) -> str:
    """Points and the figures from which the points follow, as in ``0.74: coverage 0.571, bonus 1.3``."""
    causes = ", ".join(f"{name.replace('_', ' ')} {value:.3g}" for name, value in figures.items() if name != "points")
    return f"{figures['points']:.2f}: {causes}".replace("-", "−")


def _losses(rules: Mapping[str, Mapping[str, float]]) -> Iterator[str]:
    for rule, figures in rules.items():
        if (covered := figures.get("coverage", 1.0)) < 1:
            yield f"{percent(1 - covered)} of the ground not mapped"
        if figures["points"] < 0:
            yield f"{rule}: {-figures['points']:.2f} points"
        got = figures.get("right", figures.get("discovered", 0))
        if missed := figures.get("present", got) - got:
            yield f"{rule}: {missed:.0f} missed"
        if wrong := figures.get("wrong", 0):
            yield f"{rule}: {wrong:.0f} wrong"
