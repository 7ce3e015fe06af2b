"""The page: the robot's knowledge as HTML in one file that needs nothing else."""

from collections.abc import Iterator, Mapping
from importlib.resources import files
from string import Template
from typing import Any

from pipeline.labels import Label
from pipeline.rescue_report import figures
from pipeline.rescue_report.cards import FLAT, card
from pipeline.rescue_report.map_drawing import draw_map, pale, swatch
from pipeline.rescue_report.markup import Markup, element, joined
from pipeline.rescue_report.situation import Situation
from pipeline.rescue_report.words import (
    centimetres,
    counted,
    degrees,
    metres,
    minutes,
    number,
    percent,
    place,
)

TEMPLATE = files(__package__) / "page.html"
MOST = 8
"""Places of one kind that are listed, the worst first."""


def page(situation: Situation, report: Mapping[str, Any]) -> str:
    """The whole page.

    Args:
        situation: what the robot knows.
        report: report.json's figures; only the last section, which says so, holds those that need the truth.
    """
    found = (
        f"{counted(len(situation.people), 'person', 'people')} found" if situation.people else "Nobody found"
    )
    arena = str(report["arena"])
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=joined(f"Rescue report: {arena}"),
        arena=joined(arena),
        run_line=_run_line(situation, report),
        tiles=_tiles(situation),
        summary=_summary(situation),
        map=draw_map(situation),
        legend=_legend(situation),
        entrance=joined(place(situation.T_map_entrance[:2, 3])),
        people_title=joined(found if situation.searched else "People"),
        people=_people(situation),
        sightings=_sightings(situation),
        unseen=_unseen(situation),
        hazards=_hazards(situation),
        run=figures.run_figures(report),
        scores=figures.scores(report),
        settings=figures.settings(report),
    )


def _run_line(situation: Situation, report: Mapping[str, Any]) -> Markup:
    looks = counted(len(situation.track), "look")
    time = f" in {minutes(report['sim_time_s'])}" if "sim_time_s" in report else ""
    return joined(f"A robot went in and took {looks}{time}.")


def _tiles(situation: Situation) -> Markup:
    """Three answers: who, how much, how safe."""
    return joined(_people_tile(situation), _explored_tile(situation), _way_tile(situation))


def _tile(is_good: bool, name: str, answer: str, more: str) -> Markup:
    sign = element("span", "✓" if is_good else "!", class_="sign", aria_hidden="true")
    return element(
        "div",
        sign,
        element("div", name, class_="tile-name"),
        element("div", answer, class_="tile-answer"),
        element("div", more, class_="tile-more"),
        class_="tile good" if is_good else "tile caution",
    )


def _people_tile(situation: Situation) -> Markup:
    if not situation.searched:
        return _tile(
            False, "People", "Not searched for", "The robot had no detector: anyone may be in there."
        )
    unsure = len(situation.sightings)
    more = f"and {counted(unsure, 'sighting')} not confirmed" if unsure else "no sighting left unconfirmed"
    is_good = situation.finished and not unsure
    return _tile(is_good, "People found", str(len(situation.people)), more)


def _explored_tile(situation: Situation) -> Markup:
    unseen = situation.unseen
    more = f"{number(unseen.seen, 0)} m² of ground seen, {counted(len(unseen.places), 'place')} not"
    if not situation.finished:
        return _tile(False, "Explored, stopped early", percent(unseen.share), f"{more}, nor what lies beyond")
    return _tile(not unseen.places, "Explored", percent(unseen.share), more)


def _way_tile(situation: Situation) -> Markup:
    ways = [person.route for person in situation.people]
    if not ways:
        return _ground_tile(situation)
    reached = sum(way is not None and way.arrives for way in ways)
    driven = [way for way in ways if way is not None]
    steepest = max((way.steepest for way in driven), default=0.0)
    drops = sum(way.drops > 0 for way in driven)
    slope = f"steepest ground {degrees(steepest)}" if steepest >= FLAT else "level ground"
    more = f"{slope}; drops beside {counted(drops, 'way')}"
    answer = "to everyone" if reached == len(ways) else f"to {reached} of {len(ways)}"
    return _tile(reached == len(ways) and not drops, "Drivable", answer, more)


def _ground_tile(situation: Situation) -> Markup:
    """Where nobody is to be driven to."""
    hazards = situation.hazards
    slope = f"slopes of {degrees(hazards.slopes[0].value)}" if hazards.slopes else "no slopes"
    return _tile(
        not hazards.drops, "Ground", slope, f"{counted(len(hazards.drops), 'drop')} beside drivable ground"
    )


def _summary(situation: Situation) -> Markup:
    """The whole of it in some sentences."""
    return element("p", " ".join(_sentences(situation)), class_="summary")


def _sentences(situation: Situation) -> Iterator[str]:
    for person in situation.people:
        if person.route is not None and person.route.arrives:
            continue
        yield f"The robot cannot drive up to person {person.mark}."
    if not situation.finished:
        yield "The exploration was cut short: there is more beyond the hatched border."
    if situation.hazards.ceilings:
        yield f"Low ceilings: the lowest leaves {metres(situation.hazards.ceilings[0].value)}."


def _legend(situation: Situation) -> Markup:
    signs = {
        "entrance": "entrance, and how the robot faced",
        "person": "person; ellipse: 95 % sure within",
        "sighting": "sighting, not confirmed",
        "way": "way of the robot to a person",
        "rest": "on from there, not driven",
        "track": "where the robot was",
        "unseen": "ground not seen where someone may be",
        "unknown": "nothing known",
        "slope": "slope, arrow points up",
        "drop": "drop",
    }
    seen = sorted(set(situation.labels.tolist()) - {Label.CEILING})
    colours = (
        element(
            "li", element("span", class_="patch", style=f"background:{pale(Label(k))}"), _label_name(Label(k))
        )
        for k in seen
    )
    return element(
        "ul", *(element("li", swatch(kind), text) for kind, text in signs.items()), *colours, class_="legend"
    )


def _label_name(label: Label) -> str:
    return label.name.lower().replace("_", " ")


def _people(situation: Situation) -> Markup:
    if not situation.searched:
        return element("p", "No detector ran in this episode. That nobody is shown here means nothing.")
    if not situation.people:
        return element("p", "Nobody was found where the robot has looked.")
    return joined(*(card(p, situation.T_map_entrance, confirmed=True) for p in situation.people))


def _sightings(situation: Situation) -> Markup:
    if not situation.sightings:
        return Markup()
    return element(
        "section",
        element("h2", "Sightings that are not confirmed"),
        element(
            "p",
            "Seen too seldom or from one place alone. They may be people, or something that looks like one.",
        ),
        *(card(s, situation.T_map_entrance, confirmed=False) for s in situation.sightings),
    )


def _unseen(situation: Situation) -> Markup:
    unseen = situation.unseen
    lines = [f"{number(p.area)} m² around {place(p.position)}" for p in unseen.places]
    if unseen.rest >= 0.05:
        lines.append(f"{number(unseen.rest)} m² in patches too small for a person to lie in")
    seen = f"{number(unseen.seen)} m² of ground were seen. Not seen, as far as the map tells:"
    return joined(element("p", seen), _list(lines, "nothing."))


def _hazards(situation: Situation) -> Markup:
    hazards = situation.hazards
    groups = {
        "Slopes": (
            hazards.slopes,
            lambda p: f"{degrees(p.value)} at {place(p.position)}, {number(p.area)} m²",
        ),
        "Drops": (hazards.drops, lambda p: f"{centimetres(p.value)} deep at {place(p.position)}"),
        "Low ceilings": (hazards.ceilings, lambda p: f"{metres(p.value)} of headroom at {place(p.position)}"),
    }
    return joined(
        *(
            element("div", element("h3", name), _list([tell(p) for p in found], "none found"))
            for name, (found, tell) in groups.items()
        )
    )


def _list(lines: list[str], otherwise: str) -> Markup:
    if not lines:
        return element("p", otherwise)
    more = [f"and {len(lines) - MOST} more"] if len(lines) > MOST else []
    return element("ul", *(element("li", line) for line in [*lines[:MOST], *more]))
