"""The drawing's geometry."""

import re
from base64 import b64decode
from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.grid_map import Grid
from pipeline.labels import Label
from pipeline.rescue_report.map_drawing import Paper, draw_map, pale_colour
from pipeline.rescue_report.situation import Situation
from tests.pipeline.rescue_report.html_page import Tag, read
from tests.pipeline.rescue_report.people import before_a_wall, block, victim, victims

GRID = Grid(np.array([-20, -40]), 0.05, (200, 120))


def colour_at(situation: Situation, place: tuple[float, float]) -> tuple[str, int]:
    """Colour and opacity of the map's picture at a place in m."""
    (image,) = read(draw_map(situation)).all("image")
    data = np.frombuffer(b64decode(image.attributes["href"].removeprefix("data:image/png;base64,")), np.uint8)
    pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    paper = Paper(situation.traversability.grid, ~np.isnan(situation.traversability.elevation))
    sharp = round(pixels.shape[1] / (paper.width / paper.cell))
    assert sharp > 1  # what a printer enlarges it blurs
    column, row = (paper(place) / paper.cell).astype(int)
    blue, green, red, opaque = pixels[sharp * row, sharp * column]
    return f"#{red:02x}{green:02x}{blue:02x}", opaque


def known(low: tuple[int, int], high: tuple[int, int]):
    mask = np.zeros(GRID.shape, np.bool_)
    mask[low[0] : high[0], low[1] : high[1]] = True
    return mask


def test_x_goes_right_and_y_goes_up() -> None:
    paper = Paper(GRID, known((20, 20), (120, 60)))  # 5 × 2 m from (0, −1)
    assert paper.scale == pytest.approx(1000 / 5.8)
    assert paper.height == pytest.approx(2.8 * paper.scale)
    margin = 0.4 * paper.scale
    assert paper((0, -1)) == pytest.approx([margin, paper.height - margin], abs=0.06)
    assert paper((5, 1, 7)) == pytest.approx([paper.width - margin, margin], abs=0.06)


def test_a_high_room_fits_too() -> None:
    paper = Paper(GRID, known((20, 8), (40, 112)))
    assert paper.height == pytest.approx(1000)
    assert paper.width < 400


def test_a_large_arena_gets_more_units() -> None:
    grid = Grid(np.zeros(2, np.int64), 0.05, (1040, 300))
    paper = Paper(grid, np.ones(grid.shape, np.bool_))
    assert paper.scale == pytest.approx(30)
    assert paper.width == pytest.approx(1560)


def test_an_empty_map_can_be_drawn() -> None:
    assert Paper(GRID, known((0, 0), (0, 0))).width == pytest.approx(1000)


def place_of(group: Tag) -> tuple[float, ...]:
    """Where a group of the drawing has its origin, units."""
    return tuple(map(float, re.findall(r"translate\(([\d.-]+) ([\d.-]+)\)", group.attributes["transform"])[0]))


def test_round_coordinates_stand_at_the_edges_where_they_are() -> None:
    situation = before_a_wall(None)
    paper = Paper(situation.traversability.grid, ~np.isnan(situation.traversability.elevation))
    groups = [
        (place_of(group), group) for group in read(draw_map(situation)).all("g") if group.attributes.get("transform")
    ]
    ticks = [
        (*place, float(tick.text.replace("−", "-"))) for place, group in groups for tick in group.all("text", "tick")
    ]
    along_x = {value: x for x, y, value in ticks if y == 0}
    along_y = {value: y for x, y, value in ticks if x == 0}
    assert len(along_x) >= 4 and len(along_y) >= 4
    assert all(across == paper([x, 0])[0] for x, across in along_x.items())
    assert all(up == paper([0, y])[1] for y, up in along_y.items())


def test_the_highest_class_of_a_cell_is_drawn() -> None:
    situation = before_a_wall(None)
    wall, floor = (np.array([1.62, 0.02, z], np.float32) for z in (-0.3, -0.4))
    aside, high = np.array([0.3, 0, 0], np.float32), np.array([0, 0, 2.5], np.float32)
    hidden = replace(
        situation,
        points=np.stack([floor, wall, floor + aside, wall + aside + high]),
        labels=np.array([Label.TERRAIN, Label.WALL, Label.TERRAIN, Label.CEILING], np.uint8),
    )
    assert colour_at(hidden, (1.62, 0.02)) == (pale_colour(Label.WALL), 255)
    assert colour_at(hidden, (1.92, 0.02)) == (pale_colour(Label.TERRAIN), 255)


def test_ground_without_a_class_is_drawn_where_it_was_seen_and_no_ground_where_it_was_assumed() -> None:
    situation = replace(before_a_wall(None), points=np.zeros((0, 3), np.float32), labels=np.zeros(0, np.uint8))
    assert colour_at(situation, (1.62, 0.02)) == (pale_colour(Label.UNLABELLED), 255)
    assert colour_at(situation, (0.02, 0.02))[1] == 0  # under the robot, where the camera does not look
    assert np.isfinite(situation.traversability.grid.at(situation.traversability.elevation, (0.02, 0.02)))


def test_a_person_is_drawn_where_the_map_has_them() -> None:
    person = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)))
    situation = before_a_wall(victims(person))
    root = read(draw_map(situation))
    paper = Paper(situation.traversability.grid, ~np.isnan(situation.traversability.elevation))
    (disc,) = (
        group for group in root.all("g") if group.attributes.get("transform") and any(group.all("circle", "person"))
    )
    assert place_of(disc) == pytest.approx(paper((1.6, 0.3)), abs=0.2)
    (ellipse,) = root.all("ellipse")
    assert float(ellipse.attributes["rx"]) == pytest.approx(0.2448 * paper.scale, rel=1e-3)
    (way,) = root.all("path", "way")
    first = [float(value) for value in re.findall(r"[\d.]+", way.attributes["d"])[:2]]
    assert first == pytest.approx(paper((0, 0)), abs=0.06)
