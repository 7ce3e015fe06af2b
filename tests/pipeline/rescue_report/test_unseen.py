"""What the map does not show, in rooms of known shape."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.rescue_report.unseen import AHEAD, Unseen, find_unseen
from pipeline.surface.drivable import drivable_surface
from pipeline.surface.paths import ShortestPaths
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points

ROOM = (-2.0, 2.0), (-1.5, 1.5)
NONE = np.zeros((0, 3))


def unseen(*clouds: NDArray[np.float32], frontiers: NDArray[np.float64] = NONE) -> Unseen:
    surface_map = surface_of(*clouds)
    surface = drivable_surface(surface_map)
    reachable = ShortestPaths(surface, (-1.5, 0.0)).reachable
    return find_unseen(surface, surface_map.measured, reachable, frontiers)


def without(low: float, high: float) -> NDArray[np.float32]:
    """The floor of the room but for a square."""
    points = ground_points(flat, *ROOM)
    return points[~((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1)]


def test_what_was_seen_whole_has_no_rest() -> None:
    seen = unseen(ground_points(flat, *ROOM))
    assert seen.places == []
    assert seen.area == 0
    assert seen.share == 1
    assert seen.seen == pytest.approx(12, abs=0.01)


def test_a_hole_in_the_floor_is_a_place() -> None:
    (place,) = unseen(without(0, 1)).places
    assert place.area == pytest.approx(1, abs=0.01)
    assert place.position == pytest.approx([0.5, 0.5], abs=0.05)
    assert unseen(without(0, 1)).share == pytest.approx(11 / 12, abs=0.01)


def test_a_small_hole_is_a_patch() -> None:
    seen = unseen(without(0, 0.4))
    assert seen.places == []
    assert seen.rest == pytest.approx(0.16, abs=0.01)


def test_ground_is_expected_before_a_frontier_but_not_behind_a_wall() -> None:
    floor, frontiers = ground_points(flat, *ROOM), np.array([[1.95, 0.0, 0.0]])
    seen = unseen(floor, frontiers=frontiers)
    assert seen.frontiers == 1
    (place,) = seen.places
    assert 2 < place.position[0] < 2 + AHEAD
    assert 0.5 < place.area <= np.pi / 2 * AHEAD**2
    walled = unseen(floor, wall_points((1.98, -1.5), (1.98, 1.5)), frontiers=frontiers - [0.3, 0, 0])
    assert walled.places == []


def test_a_map_of_nothing_has_no_share() -> None:
    assert Unseen([], 0.0, 0, 0.0).share == 0
