"""The headline: who, how much, how safe."""

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.rescue_report.cards import FLAT
from pipeline.rescue_report.markup import Markup, element, joined
from pipeline.rescue_report.situation import Situation
from pipeline.rescue_report.words import counted, degrees, metres, minutes, number, percent


def run_line(situation: Situation, report: Mapping[str, Any]) -> Markup:
    """What the robot did."""
    steps = counted(len(situation.steps), "look")
    time = f" in {minutes(report['sim_time_s'])}" if "sim_time_s" in report else ""
    return joined(f"A robot went in and took {steps}{time}.")


def tiles(situation: Situation) -> Markup:
    """Three answers."""
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
    more = f"{slope}; " + (f"drops beside {counted(drops, 'way')}" if drops else "no drops beside the way")
    answer = "to everyone" if reached == len(ways) else f"to {reached} of {len(ways)}"
    return _tile(reached == len(ways) and not drops, "Drivable", answer, more)


def _ground_tile(situation: Situation) -> Markup:
    """Where nobody is to be driven to."""
    hazards = situation.hazards
    slope = f"slopes of {degrees(hazards.slopes[0].value)}" if hazards.slopes else "no slopes"
    return _tile(
        not hazards.drops, "Ground", slope, f"{counted(len(hazards.drops), 'drop')} beside drivable ground"
    )


def summary(situation: Situation) -> Markup:
    """What needs a warning."""
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
