"""The map from above as SVG: x to the right, y up."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.grid_map import Grid
from pipeline.labels import COLOURS, Label
from pipeline.rescue_report.paper import Paper
from pipeline.rescue_report.rendering import TEMPLATES
from pipeline.rescue_report.situation import Situation

WHITE = 0.35
"""Share of white in the colours of the classes: what is drawn on them must stand out."""
PALETTE = (COLOURS * (1 - WHITE) + 255 * WHITE).round().astype(np.uint8)
"""(8, 3) uint8 RGB of the classes on the drawing."""
KNOWN = (238, 234, 222, 255)
"""RGBA of ground whose class is not known."""
ARROW = 0.4, 30.0
"""Between arrows up a slope: m, and units at least."""
MAX_NUMBERS = 12
"""Numbers of one kind, the worst first, that the drawing has room for."""
MIN_LINES = 6
"""Lines of round coordinates along the longer side."""
NO_CLASS = -1


def draw_map(situation: Situation) -> str:
    """The semantic map with all that a rescue team looks for on it, as an SVG element."""
    grid = situation.traversability.grid
    paper = Paper(grid, ~np.isnan(situation.traversability.elevation))
    size = np.array([paper.width, paper.height]) / paper.scale
    apart = _round_length(float(size.max()) / MIN_LINES)
    return TEMPLATES.get_template("map.svg").render(
        situation=situation,
        paper=paper,
        ground=_ground(paper, situation),
        ticks=[_multiples(apart, low, low + side) for low, side in zip(paper.low, size, strict=True)],
        digits=0 if apart >= 1 else 1,
        drops=paper(grid.centre_of(np.argwhere(situation.hazards.drop > 0))) - paper.cell / 2,
        arrows=_arrows(paper, situation),
        MAX_NUMBERS=MAX_NUMBERS,
        bar=_round_length(0.25 * paper.width / paper.scale),
    )


def pale(label: Label) -> str:
    """The colour of a class on the drawing, as #rrggbb."""
    return "#" + bytes(PALETTE[label].tolist()).hex()


def _ground(paper: Paper, situation: Situation) -> NDArray[np.uint8]:
    """(H, W, 4) RGBA: the classes of what is highest in each cell but for ceilings; clear where nothing is known."""
    image = np.zeros((*situation.traversability.grid.shape, 4), np.uint8)
    image[~np.isnan(situation.traversability.elevation)] = KNOWN
    highest = _highest(situation.traversability.grid, situation)
    image[highest != NO_CLASS, :3] = PALETTE[highest[highest != NO_CLASS]]
    image[highest != NO_CLASS, 3] = 255
    return np.ascontiguousarray(image[paper.window].transpose(1, 0, 2)[::-1])


def _highest(grid: Grid, situation: Situation) -> NDArray[np.int64]:
    """(nx, ny) class of the highest point in each cell; ``NO_CLASS`` where there is none."""
    solid = situation.labels != Label.CEILING
    points, labels = situation.points[solid], situation.labels[solid].astype(np.int64)
    i, j = grid.cell_of(points).T
    inside = (i >= 0) & (i < grid.shape[0]) & (j >= 0) & (j < grid.shape[1])
    # Height in tenths of a millimetre and class in one number: of two points the greater one is the higher.
    keys = (points[:, 2] * 1e4).astype(np.int64) * len(Label) + labels
    best = np.full(grid.shape, np.iinfo(np.int64).min)
    np.maximum.at(best, (i[inside], j[inside]), keys[inside])
    return np.where(best == np.iinfo(np.int64).min, NO_CLASS, best % len(Label))


def _arrows(paper: Paper, situation: Situation) -> Iterator[tuple[NDArray[np.float64], float]]:
    """(2,) units and heading in rad of arrows up the slopes, from the middle of each outwards, well apart."""
    grid, hazards = situation.traversability.grid, situation.hazards
    inner = ndimage.distance_transform_edt(np.pad(hazards.is_steep, 1))[1:-1, 1:-1]
    cells = np.argwhere(hazards.is_steep)
    apart = max(ARROW[0], ARROW[1] / paper.scale) / grid.cell
    for place in hazards.slopes[:MAX_NUMBERS]:  # its number stands there
        cells = cells[np.linalg.norm(cells - grid.cell_of(place.position), axis=1) > 0.8 * apart]
    while len(cells):
        cell = cells[inner[tuple(cells.T)].argmax()]
        x, y = situation.traversability.gradient[tuple(cell)]
        yield paper(grid.centre_of(cell)), float(np.arctan2(y, x))
        cells = cells[np.linalg.norm(cells - cell, axis=1) > apart]


def _multiples(step: float, low: float, high: float) -> NDArray[np.float64]:
    return step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)


def _round_length(metres: float) -> float:
    """The longest of 0.1, 0.2, 0.5, 1, 2, 5 … m that is no longer."""
    lengths = [base * 10.0**power for power in range(-1, 3) for base in (1, 2, 5)]
    return max((length for length in lengths if length <= metres), default=lengths[0])
