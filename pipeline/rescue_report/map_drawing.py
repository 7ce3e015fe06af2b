"""The map seen from above as an SVG drawing, with x to the right and y up."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import ImageColor
from scipy import ndimage

from pipeline.arrays import MaskLayer, Place
from pipeline.grid_map import Grid
from pipeline.html_page import render
from pipeline.labels import COLOURS, Label
from pipeline.rescue_report.situation import Situation
from pipeline.rescue_report.words import FILTERS

MIN_LINES = 6
"""Minimum number of lines at round coordinates along the longer side."""
MAX_EXTENT = 1000.0
"""Maximum width and height of the drawing, units; exceeded if a metre would otherwise be narrower than a symbol."""
SYMBOL_WIDTH = 30.0
"""Width of symbols, units."""
MIN_ARROW_SPACING = 45.0
"""Minimum distance between the arrows that point up a slope, units."""
BORDER = 0.4
"""Margin around the mapped cells, m."""
MAX_BAR_FRACTION = 0.25
"""Maximum length of the scale bar, as a fraction of the width."""
UNLABELLED_COLOUR = ImageColor.getrgb("linen")
"""RGB colour of ground whose class is not known."""


class Paper:
    """Converts positions in ``map``, m, to units of the drawing, which shows a window of a grid.

    Attributes:
        window: the window's ranges of cells along x and y.
        low: lower left corner of the window, m.
        scale: units per m.
        width, height: size of the drawing, units.
        cell: side of a cell of the grid, units.
    """

    def __init__(self, grid: Grid, mapped: MaskLayer):
        """Fit the drawing to the mapped cells, or to all cells if none is mapped."""
        cells = np.argwhere(mapped) if mapped.any() else np.array([[0, 0], np.subtract(grid.shape, 1)])
        margin = round(BORDER / grid.cell)
        low = np.maximum(cells.min(axis=0) - margin, 0)
        high = np.minimum(cells.max(axis=0) + 1 + margin, grid.shape)
        self.window = slice(low[0], high[0]), slice(low[1], high[1])
        self.low = grid.origin + low * grid.cell
        width, height = (high - low) * grid.cell
        self.scale = float(max(MAX_EXTENT / max(width, height), SYMBOL_WIDTH))
        self.width, self.height = float(width * self.scale), float(height * self.scale)
        self.cell = grid.cell * self.scale

    def __call__(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(..., 2) positions on the drawing, units, of points (..., 2 or 3), m."""
        x, y = np.moveaxis((np.asarray(xy, np.float64)[..., :2] - self.low) * self.scale, -1, 0)
        return np.stack([x, self.height - y], axis=-1).round(1)


def draw_map(situation: Situation) -> str:
    """The semantic map with people, paths to them, and hazards, as an SVG element."""
    grid = situation.traversability.grid
    paper = Paper(grid, ~np.isnan(situation.traversability.elevation))
    size = np.array([paper.width, paper.height]) / paper.scale
    apart = _round_length(float(size.max()) / MIN_LINES)
    return render(
        "pipeline.rescue_report",
        "map.svg",
        FILTERS,
        situation=situation,
        paper=paper,
        ground=_ground(paper, situation),
        ticks=[
            apart * np.arange(np.ceil(low / apart), np.floor((low + side) / apart) + 1)
            for low, side in zip(paper.low, size, strict=True)
        ],
        digits=0 if apart >= 1 else 1,
        drops=paper(grid.centre_of(np.argwhere(situation.hazards.drop > 0))) - paper.cell / 2,
        arrows=_arrows(paper, situation),
        bar=_round_length(MAX_BAR_FRACTION * paper.width / paper.scale),
    )


def pale_colour(label: Label) -> str:
    """The colour of a class in the drawing, as #rrggbb."""
    return "#" + bytes(_palette()[label].tolist()).hex()


def _palette() -> NDArray[np.uint8]:
    """(N, 3) colours of the N classes, mixed with a third of white so that symbols drawn on them stand out."""
    palette = COLOURS - COLOURS // 3 + np.iinfo(np.uint8).max // 3
    palette[Label.UNLABELLED] = UNLABELLED_COLOUR
    return palette


def classes_from_above(situation: Situation) -> NDArray[np.int8]:
    """(nx, ny) class of the highest point in each cell, ceilings excluded; −1 where nothing was seen.

    Ground that was seen but not classified, such as in keyframes between steps, is ``UNLABELLED``.
    """
    grid, points = situation.traversability.grid, situation.points
    classes = np.where(situation.is_seen, Label.UNLABELLED, -1).astype(np.int8)
    drawn = (situation.labels != Label.CEILING) & grid.at(np.ones(grid.shape, np.bool_), points)
    lowest_first = np.flatnonzero(drawn)[points[drawn, 2].argsort(kind="stable")]
    i, j = grid.cell_of(points[lowest_first]).T
    classes[i, j] = situation.labels[lowest_first]
    return classes


def _ground(paper: Paper, situation: Situation) -> NDArray[np.uint8]:
    """(H, W, 4) RGBA image of the classes from above; transparent where nothing was seen."""
    classes = classes_from_above(situation)
    opaque = np.where(classes < 0, 0, np.iinfo(np.uint8).max).astype(np.uint8)
    drawing = np.dstack([_palette()[classes], opaque])[paper.window].transpose(1, 0, 2)[::-1]
    # Printers blur images that they enlarge, so each cell is as many pixels wide as it is units wide.
    sharp = max(1, round(paper.cell))
    return np.ascontiguousarray(drawing.repeat(sharp, axis=0).repeat(sharp, axis=1))


def _arrows(paper: Paper, situation: Situation) -> Iterator[tuple[Place, float]]:
    """Yield the position, units, and the heading, rad, of each arrow up a slope, the innermost arrows first."""
    grid = situation.traversability.grid
    hazards = situation.hazards
    inner = ndimage.distance_transform_edt(np.pad(hazards.is_steep, 1))[1:-1, 1:-1]
    cells = np.argwhere(hazards.is_steep)
    apart = MIN_ARROW_SPACING / paper.cell
    for place in hazards.slopes[: situation.config.max_listed]:  # kept free for the place's number
        cells = cells[np.linalg.norm(cells - grid.cell_of(place.position), axis=1) > apart]
    while len(cells):
        cell = cells[inner[tuple(cells.T)].argmax()]
        x, y = situation.traversability.gradient[tuple(cell)]
        yield paper(grid.centre_of(cell)), float(np.arctan2(y, x))
        cells = cells[np.linalg.norm(cells - cell, axis=1) > apart]


def _round_length(metres: float) -> float:
    """The longest of 0.1, 0.2, 0.5, 1, 2, 5 … m that is not longer than ``metres``."""
    lengths = [base * 10.0**power for power in range(-1, 3) for base in (1, 2, 5)]
    return max((length for length in lengths if length <= metres), default=lengths[0])
