"""The map from above as SVG: x to the right, y up."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.grid_map import Grid
from pipeline.labels import COLOURS, Label
from pipeline.rescue_report.hazards import Hazards
from pipeline.rescue_report.markup import Markup, element, joined, png
from pipeline.rescue_report.paper import Paper, at, dots, line
from pipeline.rescue_report.signs import SIGNS, patterns
from pipeline.rescue_report.situation import Person, Situation
from pipeline.rescue_report.words import counted, number
from pipeline.transforms import yaw_of

PALE = 0.35
"""Share of white in the colours of the classes: what is drawn on them must stand out."""
ARROW = 0.4, 30.0
"""Between arrows up a slope: m, and units at least."""
READABLE = 0.62
"""Pixels per unit at least; on a phone the drawing is moved about."""
NOTHING = -1
"""No class."""
LINES = 6
"""Lines of round coordinates along the longer side, at least."""
MOST = 12
"""Numbers of one kind, the worst first, that the drawing has room for."""


def draw_map(situation: Situation) -> Markup:
    """The semantic map with all that a team looks for on it."""
    traversability = situation.traversability
    paper = Paper(traversability.grid, ~np.isnan(traversability.elevation))
    found = counted(len(situation.people), "person", "people")
    title = f"Map from above: {found}, the entrance, and the ways from it to them"
    return element(
        "svg",
        element("title", title),
        patterns(),
        element("rect", width=f"{paper.width:.1f}", height=f"{paper.height:.1f}", class_="unknown"),
        _ground(paper, situation),
        *_coordinates(paper),
        _drops(paper, traversability.grid, situation.hazards),
        *_slopes(paper, situation),
        element("path", d=dots(paper(situation.steps)), class_="looks"),
        *(_way(paper, person) for person in situation.everyone),
        *(_numbers(paper, situation.hazards)),
        *(_unseen(paper(place.position)) for place in situation.unseen.places),
        _entrance(paper, situation.T_map_entrance),
        *(_person(paper, person, confirmed=False) for person in situation.sightings),
        *(_person(paper, person, confirmed=True) for person in situation.people),
        _scale_bar(paper),
        _axes(paper),
        viewBox=f"0 0 {paper.width:.1f} {paper.height:.1f}",
        role="img",
        class_="drawing",
        style=f"min-width:{READABLE * paper.width:.0f}px",
    )


def pale(label: Label) -> str:
    """The colour of a class on the drawing."""
    return "#" + "".join(f"{value:02x}" for value in _palette()[label])


def _palette() -> NDArray[np.uint8]:
    """(8, 3) uint8 RGB."""
    return (COLOURS * (1 - PALE) + 255 * PALE).round().astype(np.uint8)


def _ground(paper: Paper, situation: Situation) -> Markup:
    """The classes of what is highest in each cell but for ceilings; clear where nothing is known."""
    grid = situation.traversability.grid
    image = np.zeros((*grid.shape, 4), np.uint8)
    image[~np.isnan(situation.traversability.elevation)] = (238, 234, 222, 255)
    highest = _highest(grid, situation)
    image[highest != NOTHING, :3] = _palette()[highest[highest != NOTHING]]
    image[highest != NOTHING, 3] = 255
    rows = np.ascontiguousarray(image[paper.window].transpose(1, 0, 2)[::-1])
    return element("image", href=png(rows), width=f"{paper.width:.1f}", height=f"{paper.height:.1f}")


def _highest(grid: Grid, situation: Situation) -> NDArray[np.int64]:
    """(nx, ny) class of the highest point in each cell; ``NOTHING`` where there is none."""
    solid = situation.labels != Label.CEILING
    points, labels = situation.points[solid], situation.labels[solid].astype(np.int64)
    i, j = grid.cell_of(points).T
    inside = (i >= 0) & (i < grid.shape[0]) & (j >= 0) & (j < grid.shape[1])
    # Height in tenths of a millimetre and class in one number: of two points the greater one is the higher.
    keys = (points[:, 2] * 1e4).astype(np.int64) * len(Label) + labels
    best = np.full(grid.shape, np.iinfo(np.int64).min)
    np.maximum.at(best, (i[inside], j[inside]), keys[inside])
    return np.where(best == np.iinfo(np.int64).min, NOTHING, best % len(Label))


def _coordinates(paper: Paper) -> Iterator[Markup]:
    """Lines of round x and y with their numbers, by which to find places that the page names."""
    size = np.array([paper.width, paper.height]) / paper.scale
    apart = _round_length(float(size.max()) / LINES)
    first, last = np.ceil(paper.low / apart).astype(int), np.floor((paper.low + size) / apart).astype(int)
    for x in apart * np.arange(first[0], last[0] + 1):
        across, _ = paper([x, 0])
        yield element("path", d=f"M{across:.1f} 0V{paper.height:.1f}", class_="coordinate")
        yield _text(np.array([across, 16]), number(x, 0 if apart >= 1 else 1), "tick")
    for y in apart * np.arange(first[1], last[1] + 1):
        _, up = paper([0, y])
        yield element("path", d=f"M0 {up:.1f}H{paper.width:.1f}", class_="coordinate")
        yield _text(np.array([16, up + 5]), number(y, 0 if apart >= 1 else 1), "tick")


def _drops(paper: Paper, grid: Grid, hazards: Hazards) -> Markup:
    corners = paper(grid.centre_of(np.argwhere(hazards.drop > 0))) - paper.cell / 2
    size = f"{paper.cell:.1f}"
    d = "".join(f"M{x:.1f} {y:.1f}h{size}v{size}h-{size}z" for x, y in corners)
    return element("path", d=d, class_="drop")


def _slopes(paper: Paper, situation: Situation) -> Iterator[Markup]:
    """Arrows up the slopes, from the middle of each slope outwards, well apart."""
    grid = situation.traversability.grid
    inner = ndimage.distance_transform_edt(np.pad(situation.hazards.is_steep, 1))[1:-1, 1:-1]
    cells = np.argwhere(situation.hazards.is_steep)
    apart = max(ARROW[0], ARROW[1] / paper.scale) / grid.cell
    for place in situation.hazards.slopes[:MOST]:  # its number stands there
        cells = cells[np.linalg.norm(cells - grid.cell_of(place.position), axis=1) > 0.8 * apart]
    while len(cells):
        cell = cells[inner[tuple(cells.T)].argmax()]
        x, y = situation.traversability.gradient[tuple(cell)]
        yield _arrow(paper(grid.centre_of(cell)), float(np.degrees(np.arctan2(-y, x))))
        cells = cells[np.linalg.norm(cells - cell, axis=1) > apart]


def _arrow(middle: NDArray[np.float64], degrees: float) -> Markup:
    return element("g", SIGNS["slope"], transform=f"translate({at(middle)}) rotate({degrees:.0f})")


def _numbers(paper: Paper, hazards: Hazards) -> Iterator[Markup]:
    """How steep, how deep and how low."""
    for place in hazards.slopes[:MOST]:
        yield _text(paper(place.position), f"{np.degrees(place.value):.0f}°", "number")
    for place in hazards.drops[:MOST]:
        yield _text(paper(place.position), f"↓{100 * place.value:.0f} cm", "number")
    for place in hazards.ceilings[:MOST]:
        yield _text(paper(place.position), f"↕{place.value:.1f} m", "number")


def _way(paper: Paper, person: Person) -> Markup:
    """The way to someone, and on from its end as far as the robot cannot go."""
    if person.route is None:
        return Markup()
    way = paper(person.route.way)
    rest = np.stack([way[-1], paper(person.victim.position)])
    return joined(
        element("path", d=line(way), class_="casing"),
        element("path", d=line(way), class_="way"),
        element("path", d=line(rest), class_="rest"),
    )


def _person(paper: Paper, person: Person, *, confirmed: bool) -> Markup:
    """A disc with their mark, and where they are with 95 % certainty."""
    x, y = paper(person.victim.position)
    values, vectors = np.linalg.eigh(person.victim.covariance[:2, :2])
    b, a = np.sqrt(5.991 * values) * paper.scale  # χ² of two degrees of freedom
    degrees = np.degrees(np.arctan2(-vectors[1, 1], vectors[0, 1]))
    turned = f"translate({x} {y}) rotate({degrees:.0f})"
    kind = "person" if confirmed else "sighting"
    return joined(
        element("ellipse", rx=f"{a:.1f}", ry=f"{b:.1f}", transform=turned, class_="certainty"),
        element("circle", cx=x, cy=y, r=13, class_=kind),
        _text(np.array([x, y + 6]), person.mark, f"{kind}-mark"),
    )


def _unseen(place: NDArray[np.float64]) -> Markup:
    return element("g", SIGNS["unseen"], transform=f"translate({at(place)})")


def _entrance(paper: Paper, T: NDArray[np.float64]) -> Markup:
    place, degrees = paper(T[:2, 3]), -np.degrees(yaw_of(T))
    return joined(
        element("g", SIGNS["entrance"], transform=f"translate({at(place)}) rotate({degrees:.0f})"),
        _text(place + np.array([0, 34]), "Entrance", "name"),
    )


def _scale_bar(paper: Paper) -> Markup:
    """Black and white metres along the lower edge."""
    metres = _round_length(0.25 * paper.width / paper.scale)
    length, y = metres * paper.scale, paper.height - 16
    return joined(
        element("rect", x=8, y=y - 24, width=f"{length + 48:.1f}", height=36, class_="plate"),
        element("rect", x=22, y=y, width=f"{length:.1f}", height=6, class_="bar"),
        element("rect", x=22, y=y, width=f"{length / 2:.1f}", height=6, class_="bar-half"),
        _text(np.array([22.0, y - 6]), "0", "scale"),
        _text(np.array([22.0 + length, y - 6]), f"{metres:g} m", "scale"),
    )


def _round_length(metres: float) -> float:
    """The longest of 0.5, 1, 2, 5, 10, 20 m … that is no longer."""
    lengths = [base * 10.0**power for power in range(-1, 3) for base in (1, 2, 5)]
    return max((length for length in lengths if length <= metres), default=lengths[0])


def _axes(paper: Paper) -> Markup:
    """Where x and y of the map point: the robot has no compass."""
    x, y = paper.width - 56, paper.height - 20
    return joined(
        element("rect", x=x - 22, y=y - 54, width=72, height=68, class_="plate"),
        element("path", d=f"M{x:.1f} {y - 34:.1f}V{y:.1f}h34", class_="axes"),
        element("path", d=f"M{x - 5:.1f} {y - 32:.1f}l5 -10l5 10zM{x + 32:.1f} {y - 5:.1f}l10 5l-10 5z"),
        _text(np.array([x - 12, y - 30]), "y", "scale"),
        _text(np.array([x + 34, y - 10]), "x", "scale"),
    )


def _text(place: NDArray[np.float64], text: str, kind: str) -> Markup:
    return element("text", text, x=f"{place[0]:.1f}", y=f"{place[1]:.1f}", class_=kind)
