"""Pieces of one plane are one segment where the map holds their gap."""

import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import MetricMap
from pipeline.segments.segments import Segments
from tests.pipeline.segments.patches import deck, wall_patch


def joined(is_surface, *patches):
    """The segments of patches of one keyframe in a map with this surface."""
    segments = Segments(is_surface)
    segments.update(patches, 0, np.eye(4))
    return list(segments)


def everywhere(points, normal):
    return np.ones(len(points), bool)


def beside(low, high, bottom=-1.0):
    """A surface wherever x is not between ``low`` and ``high``, and there too below ``bottom``."""
    return lambda points, normal: (points[:, 0] < low) | (points[:, 0] > high) | (points[:, 2] < bottom)


@pytest.mark.parametrize("gap", [0.16, 0.3, 1.2, 5.0])
def test_wall_whose_gap_the_map_holds_is_one_segment(gap: float) -> None:
    (wall,) = joined(everywhere, wall_patch(0, 1), wall_patch(1 + gap, 3 + gap, z1=0.8))
    assert wall.id == 0
    assert wall.box.extent[:2] == pytest.approx([3 + gap, 1.2], abs=1e-2)


@pytest.mark.parametrize("width", [0.1, 0.8])
@pytest.mark.parametrize("gap", [0.8, 4.0])
def test_door_in_a_gap_parts_the_wall(width: float, gap: float) -> None:
    door = beside(1 + gap / 2 - width / 2, 1 + gap / 2 + width / 2)
    assert len(joined(door, wall_patch(0, 1), wall_patch(1 + gap, 3 + gap))) == 2


@pytest.mark.parametrize(("bottom", "pieces"), [(0.2, 2), (0.5, 2), (0.8, 1)])
def test_gap_is_closed_if_most_of_its_height_is(bottom: float, pieces: int) -> None:
    assert len(joined(beside(1, 2, bottom), wall_patch(0, 1), wall_patch(2, 3))) == pieces


@pytest.mark.parametrize("other", [wall_patch(2, 3, y=0.1), wall_patch(2, 3, front=False), deck(2, 3, 0, 1)])
def test_surfaces_of_other_planes_stay_apart(other) -> None:
    assert len(joined(everywhere, wall_patch(0, 1), other)) == 2


def test_other_classes_stay_apart() -> None:
    assert len(joined(everywhere, deck(0, 1, 0, 1), deck(1.5, 2, 0, 1, label=Label.TERRAIN))) == 2


@pytest.mark.parametrize("gap", [0.0, 0.3, 1.0])
def test_decks_that_face_each_other_with_corners_stay_apart(gap: float) -> None:
    assert len(joined(everywhere, deck(0, 1, 0, 1), deck(1 + gap, 2 + gap, 1 + gap, 2 + gap))) == 2


def test_row_of_pieces_is_one_segment_up_to_the_open_gap() -> None:
    pieces = [wall_patch(x, x + 0.4) for x in (3, 0, 1, 2, 4)]
    left, right = sorted(joined(beside(2.5, 2.9), *pieces), key=lambda s: s.box.T_map_box[0, 3])
    assert (left.members, right.members) == ((1, 2, 3), (0, 4))
    assert [s.box.extent[0] for s in (left, right)] == pytest.approx([2.4, 1.4], abs=1e-2)


def test_gap_that_the_map_opens_parts_the_wall_again() -> None:
    is_open = []
    segments = Segments(lambda points, normal: np.full(len(points), not is_open))
    segments.update([wall_patch(0, 1), wall_patch(1.5, 2.5)], 0, np.eye(4))
    assert len(segments) == 1
    is_open.append(True)
    segments.update([], 1, np.eye(4))
    assert [s.members for s in segments] == [(0,), (1,)]


def seen_wall(camera_y: float, gap: tuple[float, float]) -> MetricMap:
    """A map of a wall at y = 0, 3 m long, seen from a place at ``camera_y``, m, with an opening in x."""
    metric_map, grid = MetricMap(MetricMapConfig(voxel_size=0.1)), np.arange(0.01, 3, 0.02)
    x, z = (g.ravel() for g in np.meshgrid(grid, grid[grid < 1.2]))
    is_open = (x > gap[0]) & (x < gap[1])
    through = np.where(is_open, -np.sign(camera_y), 0.0)
    metric_map.integrate_points(np.column_stack([x, through, z]), (1.5, camera_y, 0.6))
    return metric_map


@pytest.mark.parametrize(
    ("camera_y", "gap", "pieces"),
    [(-1.5, (0, 0), 1), (-1.5, (1.1, 1.9), 2), (1.5, (0, 0), 2)],
    ids=["a wall", "a door", "a wall seen from behind alone"],
)
def test_the_metric_map_closes_the_gap_of_a_wall_seen_from_this_side(camera_y, gap, pieces) -> None:
    metric_map = seen_wall(camera_y, gap)
    assert len(joined(metric_map.is_surface, wall_patch(0, 1), wall_patch(2, 3))) == pieces


@pytest.mark.parametrize("wall_height", [0.0, 1.0])
def test_two_decks_of_one_height_are_one_surface_only_without_a_wall_between_them(wall_height) -> None:
    metric_map, grid = MetricMap(MetricMapConfig(voxel_size=0.1)), np.arange(0.01, 3, 0.02)
    x, y = (g.ravel() for g in np.meshgrid(grid, grid[grid < 1]))
    level = np.column_stack([x, y, np.full_like(x, 0.3)])
    y, z = (g.ravel() for g in np.meshgrid(grid[grid < 1], np.arange(0.31, 0.3 + wall_height, 0.02)))
    for side, eye in ((-1, 0.3), (1, 2.7)):  # a wall from x = 1.4 to 1.6, seen from both its sides
        wall = np.column_stack([np.full_like(y, 1.5 + 0.1 * side), y, z])
        near = level[side * (level[:, 0] - 1.5) > 0.1] if wall_height else level
        metric_map.integrate_points(np.vstack([near, wall]), (eye, 0.5, 1.0))
    pieces = joined(metric_map.is_surface, deck(0, 1, 0, 1, z=0.3), deck(2, 3, 0, 1, z=0.3))
    assert len(pieces) == (2 if wall_height else 1)
