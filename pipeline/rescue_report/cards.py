"""A card for everyone who was found."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.rescue_report.hazards import SLOPE
from pipeline.rescue_report.markup import Markup, element, joined, jpeg
from pipeline.rescue_report.routes import Leg, Route
from pipeline.rescue_report.situation import Person
from pipeline.rescue_report.words import (
    centimetres,
    counted,
    degrees,
    metres,
    number,
    percent,
    place,
    side,
    turn,
)
from pipeline.transforms import yaw_of

FLAT = np.deg2rad(3)
"""rad; a way that is nowhere steeper is level."""


def card(person: Person, T_map_entrance: NDArray[np.float64], *, confirmed: bool) -> Markup:
    """What is known of someone, and how to get there from the entrance (4×4)."""
    victim, name = person.victim, f"{'Person' if confirmed else 'Sighting'} {person.mark}"
    photo = element(
        "img", src=jpeg(victim.photo), alt=f"{name} as the robot's camera saw it: cut out of one picture"
    )
    rows = [*_about(person, T_map_entrance), *_way_in(person.route)]
    facts = element("dl", *(element("div", element("dt", k), element("dd", v)) for k, v in rows))
    return element(
        "article",
        element("h3", element("span", person.mark, class_="disc"), name),
        element("div", photo, class_="photo"),
        element("div", facts, _directions(person.route), class_="facts"),
        class_="card" if confirmed else "card unconfirmed",
    )


def _about(person: Person, T_map_entrance: NDArray[np.float64]) -> Iterator[tuple[str, object]]:
    victim, posture = person.victim, person.posture
    away = victim.position - T_map_entrance[:3, 3]
    bearing = float(np.arctan2(away[1], away[0])) - yaw_of(T_map_entrance)
    x, y, z = (number(value, 2) for value in victim.position)
    certain = float(np.sqrt(5.991 * np.linalg.eigvalsh(victim.covariance[:2, :2])[-1]))
    sigma = " / ".join(number(value, 2) for value in np.sqrt(np.diag(victim.covariance)))
    yield (
        "Where",
        joined(
            element("b", f"x {x}, y {y}, z {z} m"),
            f" on the map, 95 % sure within {metres(certain)} (σ {sigma} m); as the crow flies "
            f"{metres(float(np.linalg.norm(away[:2])))} from the entrance, {side(bearing)}",
        ),
    )
    size = " × ".join(number(value) for value in (posture.length, posture.width, posture.height))
    yield "Size", f"{size} m (length × width × height of what was seen)"
    yield (
        "Posture",
        f"{posture.name}, judging by the size alone" if posture.name else "not to be told from this size",
    )
    steps = counted(len(victim.cameras), "look")
    apart = f", up to {metres(victim.apart)} apart" if len(victim.cameras) > 1 else ""
    missed = f"; {counted(victim.missed, 'look')} that should have shown it did not" if victim.missed else ""
    yield "Seen", joined(element("b", f"{percent(victim.confidence)} sure"), f", {steps}{apart}{missed}")


def _way_in(route: Route | None) -> Iterator[tuple[str, object]]:
    if route is None:
        yield "Way in", _warning("The robot's map has no way out of the entrance.")
        return
    slope = "on level ground" if route.steepest < FLAT else f"steepest ground {degrees(route.steepest)}"
    way = element("b", f"{metres(route.length)} to drive, {slope}")
    if route.arrives:
        yield "Way in", joined(way, f"; it ends {metres(route.gap)} from the person")
    else:
        why = "" if route.in_sight else ", and something stands between"
        yield (
            "Way in",
            _warning(
                f"No way up to the person. The nearest place that the robot can reach is {place(route.way[-1, :2])}, "
                f"{metres(route.gap)} away{why}: ",
                way,
            ),
        )
    if route.drops:
        deepest = centimetres(route.drop)
        drops = f"a drop of {deepest}" if route.drops == 1 else f"{route.drops} drops, the deepest {deepest}"
        yield "Beside it", _warning(drops)


def _warning(*content: object) -> Markup:
    return element("span", element("span", "⚠ ", class_="warning-sign"), *content, class_="warning")


def _directions(route: Route | None) -> Markup:
    if route is None or not route.legs:
        return Markup()
    steps = [element("li", _step(leg, first=k == 0)) for k, leg in enumerate(route.legs)]
    return element(
        "details", element("summary", "Directions from the entrance"), element("ol", *steps), open=""
    )


def _step(leg: Leg, *, first: bool) -> str:
    way = turn(leg.turn) if not first else f"facing in as the robot did, {turn(leg.turn)}"
    slope = f", over a slope of {degrees(leg.steepest)}" if leg.steepest > SLOPE else ""
    return f"{way[0].upper()}{way[1:]}: {metres(leg.length)}{slope}"
