"""The drawing's geometry."""

import re

import numpy as np
import pytest

from pipeline.rescue_report.map_drawing import draw_map
from pipeline.rescue_report.paper import LONGER, MARGIN, Paper
from pipeline.surface.grid import Grid
from tests.pipeline.rescue_report.html_page import read
from tests.pipeline.rescue_report.people import before_a_wall, block, victim, victims

GRID = Grid(np.array([-1.0, -2.0]), 0.05, (200, 120))


def known(low: tuple[int, int], high: tuple[int, int]):
    mask = np.zeros(GRID.shape, np.bool_)
    mask[low[0] : high[0], low[1] : high[1]] = True
    return mask


def test_x_goes_right_and_y_goes_up() -> None:
    paper = Paper(GRID, known((20, 20), (120, 60)))  # 5 × 2 m from (0, −1)
    assert paper.scale == pytest.approx(LONGER / (5 + 2 * MARGIN))
    assert paper.height == pytest.approx((2 + 2 * MARGIN) * paper.scale)
    margin = MARGIN * paper.scale
    assert paper((0, -1)) == pytest.approx([margin, paper.height - margin], abs=0.06)
    assert paper((5, 1, 7)) == pytest.approx([paper.width - margin, margin], abs=0.06)


def test_a_high_room_fits_too() -> None:
    paper = Paper(GRID, known((20, 8), (40, 112)))
    assert paper.height == pytest.approx(800)
    assert paper.width < 400


def test_an_empty_map_can_be_drawn() -> None:
    assert Paper(GRID, known((0, 0), (0, 0))).width == LONGER


def test_someone_stands_where_they_are() -> None:
    person = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)))
    situation = before_a_wall(victims(person))
    root = read(draw_map(situation))
    paper = Paper(situation.surface.grid, ~np.isnan(situation.surface.elevation))
    (disc,) = root.all("circle", "person")
    assert (float(disc.attributes["cx"]), float(disc.attributes["cy"])) == pytest.approx(
        paper((1.6, 0.3)), abs=0.2
    )
    (ellipse,) = root.all("ellipse")
    assert float(ellipse.attributes["rx"]) == pytest.approx(0.2448 * paper.scale, rel=1e-3)
    (way,) = root.all("path", "way")
    first = [float(value) for value in re.findall(r"[\d.]+", way.attributes["d"])[:2]]
    assert first == pytest.approx(paper((0, 0)), abs=0.06)
