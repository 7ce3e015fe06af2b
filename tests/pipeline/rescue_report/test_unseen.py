"""Unseen ground in rooms of known shape."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import assess_map
from pipeline.planning.pose_paths import PosePaths
from pipeline.rescue_report.config import UnseenConfig
from pipeline.rescue_report.unseen import Unseen, find_unseen
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points

ROOM = (-2.0, 2.0), (-1.5, 1.5)
WALLS = [
    wall_points(a, b) for a, b in (((-1.98, -1.5), (-1.98, 1.5)), ((-2, -1.48), (2, -1.48)), ((-2, 1.48), (2, 1.48)))
]
LAST_WALL = wall_points((1.98, -1.5), (1.98, 1.5))


def unseen(*clouds: NDArray[np.float32]) -> Unseen:
    """The unseen ground in a room with three walls and these clouds."""
    elevation_map = surface_of(*clouds, *WALLS)
    traversability = assess_map(elevation_map)
    reachable = PosePaths(traversability, (-1.5, 0.0)).reachable
    return find_unseen(traversability, elevation_map.measured, reachable, PIONEER, UnseenConfig(ahead=1.0))


def without(low: float, high: float) -> NDArray[np.float32]:
    """The floor of the room but for a square."""
    points = ground_points(flat, *ROOM)
    return points[~((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1)]


def test_what_was_seen_whole_has_no_rest() -> None:
    seen = unseen(ground_points(flat, *ROOM), LAST_WALL)
    assert seen.places == []
    assert seen.area == 0
    assert seen.share == 1
    # All but the cells of the walls.
    assert seen.seen == pytest.approx(3.9 * 2.9, abs=0.01)


def test_a_hole_in_the_floor_is_a_place() -> None:
    seen = unseen(without(0, 1), LAST_WALL)
    (place,) = seen.places
    assert place.area == pytest.approx(1, abs=0.01)
    assert place.position == pytest.approx([0.5, 0.5], abs=0.05)
    assert seen.share == pytest.approx(1 - 1 / (3.9 * 2.9), abs=0.01)


def test_ground_that_no_robot_can_stand_on_was_seen_but_its_share_is_unknown() -> None:
    elevation_map = surface_of(ground_points(flat, *ROOM), LAST_WALL, *WALLS)
    traversability = assess_map(elevation_map)
    nowhere = np.zeros(traversability.grid.shape, np.bool_)
    seen = find_unseen(traversability, elevation_map.measured, nowhere, PIONEER, UnseenConfig())
    assert seen.seen == pytest.approx(3.9 * 2.9, abs=0.01)
    assert seen.share is None


def test_a_small_hole_is_a_patch() -> None:
    seen = unseen(without(0, 0.4), LAST_WALL)
    assert seen.places == []
    assert seen.rest == pytest.approx(0.16, abs=0.01)


def test_ground_is_expected_ahead_where_no_wall_is() -> None:
    (place,) = unseen(ground_points(flat, *ROOM)).places
    reach = 1.0 - 0.25  # the robot's middle keeps off unknown ground
    assert 2 < place.position[0] < 2 + reach
    assert 2.4 * reach < place.area < 4 * reach  # as wide as the robot's middle can go, or as the room and more


def test_no_ground_is_expected_through_a_gap_in_what_was_seen_of_a_wall() -> None:
    gap = LAST_WALL[np.abs(LAST_WALL[:, 1]) > 0.05]
    assert unseen(ground_points(flat, *ROOM), gap).places == []


def test_a_map_of_nothing_has_no_share() -> None:
    assert Unseen([], 0.0, 0.0, is_reachable=True).share is None
