"""Walls, posts, barrels, and the sides of ramps and decks, of exact points."""

import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.robot import RobotModel
from pipeline.semantic_map.uprights import (
    TopDownProjection,
    with_sides_of_ramps,
    with_whole_uprights,
    with_whole_walls,
)
from pipeline.semantic_map.uprights_kernels import directions, is_on_long_run
from sarsim.robots.skid_steered import robot_model

WALL, CLUTTER, DECK, RAMP = Label.WALL, Label.CLUTTER, Label.STRAIGHT_RAMP, Label.INCLINED_RAMP
VOXEL, CELL = 0.02, 0.05  # m
WIDTH, GAP, HEADROOM = 0.25, 0.15, 0.65  # m


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return robot_model()


def grid(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> np.ndarray:
    """Points in the middle of the voxels of a box; a single number twice makes it flat."""
    sides = [np.arange(low, max(high, low + VOXEL / 2), VOXEL) + VOXEL / 2 for low, high in (x, y, z)]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


def labelled(*parts: tuple[np.ndarray, Label]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All points, their labels, and the number of the part of each."""
    points = np.concatenate([part for part, _ in parts])
    labels = np.concatenate([np.full(len(part), label, np.uint8) for part, label in parts])
    return points, labels, np.repeat(np.arange(len(parts)), [len(part) for part, _ in parts])


def of_walls(*parts: tuple[np.ndarray, Label]) -> list[set[int]]:
    points, labels, part = labelled(*parts)
    result = with_whole_walls(TopDownProjection.of(points, VOXEL), labels, WIDTH, GAP)
    return [set(result[part == n].tolist()) for n in range(len(parts))]


def of_sides(*parts: tuple[np.ndarray, Label]) -> list[set[int]]:
    points, labels, part = labelled(*parts)
    result = with_sides_of_ramps(TopDownProjection.of(points, CELL), labels, HEADROOM)
    return [set(result[part == n].tolist()) for n in range(len(parts))]


def test_a_wall_stays_to_its_corner_and_a_post_before_it_is_clutter() -> None:
    wall, corner, around = (
        grid(x, y, (0, 0.4)) for x, y in (((0, 1), (0, 0)), ((1, 1), (0, 0)), ((1, 1), (0.02, 1)))
    )
    post = grid((0.4, 0.5), (0.1, 0.1), (0, 0.4))
    found = of_walls((wall, WALL), (around, WALL), (post, WALL), (corner, WALL))
    assert found[:3] == [{WALL}, {WALL}, {CLUTTER}]


@pytest.mark.parametrize(("wide", "label"), [(0.24, CLUTTER), (0.26, WALL)])
def test_a_wall_is_as_wide_as_asked(wide: float, label: Label) -> None:
    assert of_walls((grid((0, wide), (0, 0), (0, 0.4)), WALL)) == [{label}]


def test_a_barrel_is_round() -> None:
    angle, z = np.meshgrid(np.linspace(0, np.pi, 100), np.arange(0, 0.8, VOXEL))
    barrel = np.stack([0.29 * np.cos(angle), 0.29 * np.sin(angle), z], axis=-1).reshape(-1, 3).astype(np.float32)
    assert of_walls((barrel, WALL)) == [{CLUTTER}]


def test_slats_with_gaps_that_the_robot_could_bridge_are_a_wall() -> None:
    slats = [grid((x, x), (0, 0), (0, 1)) for x in np.arange(0.0, 1.0, 0.12)]
    assert of_walls(*((slat, WALL) for slat in slats)) == [{WALL}] * len(slats)


def test_clutter_in_a_wall_is_wall_but_not_before_it() -> None:
    below, speck = grid((0, 1), (0, 0), (0, 0.4)), grid((0.4, 0.6), (0, 0), (0.4, 0.5))
    box = grid((0.4, 0.6), (0.1, 0.1), (0, 0.4))
    assert of_walls((below, WALL), (speck, CLUTTER), (box, CLUTTER)) == [{WALL}, {WALL}, {CLUTTER}]


def test_the_sides_of_a_deck_have_its_label() -> None:
    deck, side = grid((0, 1), (0, 1), (0.3, 0.3)), grid((0, 1), (1, 1), (0, 0.3))
    for label in (WALL, RAMP, DECK):
        assert of_sides((deck, DECK), (side, label)) == [{DECK}, {DECK}]


@pytest.mark.parametrize("z", [(0, 0.5), (0, 0.2)])
def test_a_wall_that_does_not_end_at_the_deck_is_a_wall(z: tuple[float, float]) -> None:
    deck, wall = grid((0, 1), (0, 1), (0.3, 0.3)), grid((0, 1), (1.02, 1.02), z)
    assert of_sides((deck, DECK), (wall, WALL)) == [{DECK}, {WALL}]


def test_a_wall_under_a_deck_with_headroom_is_a_wall() -> None:
    deck, wall = grid((0, 1), (0, 1), (1.1, 1.1)), grid((0, 1), (1, 1), (0, 1.1))
    assert of_sides((deck, DECK), (wall, WALL)) == [{DECK}, {WALL}]


def test_without_ramps_and_without_points_nothing_changes(robot: RobotModel) -> None:
    wall = grid((0, 1), (0, 0), (0, 0.4))
    assert of_sides((wall, WALL)) == [{WALL}]
    nothing = np.zeros((0, 3), np.float32), np.zeros(0, np.uint8)
    assert len(with_whole_uprights(*nothing, robot, VOXEL, CELL)) == 0


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 135.0])
def test_the_direction_of_a_line_is_found(angle: float) -> None:
    t = np.linspace(-20, 20, 200)
    line = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    counts = np.zeros((50, 50), np.int32)
    np.add.at(counts, tuple(np.round(25 + t[:, None] * line).astype(int).T), 1)
    found = directions(counts, 6)
    assert np.isnan(found[counts == 0]).all()
    assert abs(np.sin(found[25, 25] - np.deg2rad(angle))) < np.sin(np.deg2rad(3))


def test_a_run_bridges_gaps_and_ends_where_the_direction_changes() -> None:
    direction = np.full((1, 20), np.nan, np.float32)
    direction[0, [0, 1, 4, 5]] = np.pi / 2
    direction[0, 6] = 0.0
    bridged = is_on_long_run(direction, 6, 2, 0.1)
    assert np.flatnonzero(bridged[0]).tolist() == [0, 1, 4, 5]
    assert not is_on_long_run(direction, 7, 2, 0.1).any()
    assert not is_on_long_run(direction, 6, 1, 0.1).any()
