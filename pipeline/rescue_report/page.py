"""The page: the robot's knowledge as HTML in one file that needs nothing else."""

from collections.abc import Mapping
from importlib.resources import files
from string import Template
from typing import Any

from pipeline.labels import Label
from pipeline.rescue_report import figures
from pipeline.rescue_report.cards import card
from pipeline.rescue_report.headline import run_line, summary, tiles
from pipeline.rescue_report.map_drawing import draw_map, pale
from pipeline.rescue_report.markup import Markup, element, joined
from pipeline.rescue_report.signs import swatch
from pipeline.rescue_report.situation import Situation
from pipeline.rescue_report.words import centimetres, counted, degrees, metres, number, place

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
        run_line=run_line(situation, report),
        tiles=tiles(situation),
        summary=summary(situation),
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


def _legend(situation: Situation) -> Markup:
    signs = {
        "entrance": "entrance, and how the robot faced",
        "person": "person; ellipse: 95 % sure within",
        "sighting": "sighting, not confirmed",
        "way": "way of the robot to a person",
        "rest": "on from there, not driven",
        "looks": "where the robot looked from",
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
            "Seen too seldom, too little of, or from one place alone. They may be people, or something like them.",
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
