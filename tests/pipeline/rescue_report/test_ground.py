"""Hazards and unseen ground of known shape."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import assess_map
from pipeline.planning.pose_paths import PosePaths
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.ground import Hazards, Unseen, find_hazards, find_unseen
from tests.pipeline.worlds import RISE, RUN, flat, ground_points, ridge, surface_of, wall_points

AREA = (-1.5, 1.5), (-1.0, 1.0)
NO_POINTS = np.zeros((0, 3), np.float32)


def hazards_of(*clouds: NDArray[np.float32], start=(-1.0, 0.0), above: NDArray[np.float32] = NO_POINTS) -> Hazards:
    traversability = assess_map(surface_of(*clouds))
    reachable = PosePaths(traversability, start).reachable
    return find_hazards(traversability, reachable, np.vstack([*clouds, above]), RescueReportConfig())


def terrace(x: NDArray, y: NDArray) -> NDArray:
    """Level ground that is 0.4 m lower where y > 0.5."""
    return np.where(y > 0.5, -0.4, 0.0) + 0 * x


@pytest.mark.parametrize(
    "beside",
    [wall_points((-1.5, 0.9), (1.5, 0.9)), ground_points(lambda x, y: 0 * x + 0.25, (0.2, 0.6), (-0.2, 0.2))],
)
def test_level_ground_beside_a_wall_or_a_block_has_no_hazards(beside: NDArray[np.float32]) -> None:
    high = ground_points(lambda x, y: np.full_like(x, 2.4), *AREA)
    hazards = hazards_of(ground_points(flat, *AREA), beside, above=high)
    assert hazards.slopes == hazards.drops == hazards.ceilings == []


def test_both_sides_of_a_ridge_are_slopes() -> None:
    hazards = hazards_of(ground_points(ridge, *AREA))
    assert [place.value for place in hazards.slopes] == pytest.approx([np.arctan(RISE / RUN)] * 2, abs=0.01)
    assert sorted(place.position[0] for place in hazards.slopes) == pytest.approx([-RUN / 2, RUN / 2], abs=0.08)
    assert hazards.drops == []


def test_an_edge_is_a_drop_from_above_alone() -> None:
    ground = ground_points(terrace, *AREA)
    (drop,) = hazards_of(ground).drops
    assert drop.value == pytest.approx(0.4, abs=0.001)
    assert drop.position == pytest.approx([0, 0.475], abs=0.051)
    assert hazards_of(ground, start=(0.0, 0.9)).drops == []


def test_a_drop_to_ground_that_is_seen_from_afar() -> None:
    above, below = (ground_points(flat, (-1.5, 1.5), (-1.0, 0.5)), ground_points(terrace, (-1.5, 1.5), (0.9, 1.5)))
    (drop,) = hazards_of(above, below).drops
    assert drop.value == pytest.approx(0.4, abs=0.001)


@pytest.mark.parametrize(("width", "drops"), [(0.1, 0), (0.3, 1)])
def test_a_slit_beside_the_ground_is_no_drop(width: float, drops: int) -> None:
    ground = ground_points(terrace, (-1.5, 1.5), (-1.0, 0.5 + width))
    wall = wall_points((-1.5, 0.53 + width), (1.5, 0.53 + width))
    assert len(hazards_of(ground, wall).drops) == drops


def test_there_is_no_drop_to_the_ground_behind_a_wall() -> None:
    above, below = (ground_points(flat, (-1.5, 1.5), (-1.0, 0.5)), ground_points(terrace, (-1.5, 1.5), (0.6, 1.5)))
    # A kerb in front of the wall, like the lower part of a wall that is seen badly.
    kerb = ground_points(lambda x, y: np.full_like(x, 0.05), (-1.5, 1.5), (0.45, 0.5))
    wall = wall_points((-1.5, 0.53), (1.5, 0.53))
    assert hazards_of(above, kerb, below).drops != []
    assert hazards_of(above, kerb, wall, below).drops == []


def test_what_hangs_low_is_a_ceiling() -> None:
    beam = ground_points(lambda x, y: np.full_like(x, 1.3), (0.0, 0.2), (-0.3, 0.3))
    hazards = hazards_of(ground_points(flat, *AREA), above=beam)
    (ceiling,) = hazards.ceilings
    assert ceiling.value == pytest.approx(1.3, abs=0.001)
    assert ceiling.position == pytest.approx([0.1, 0.0], abs=0.051)
    assert ceiling.area == pytest.approx(0.2 * 0.6, abs=0.001)


ROOM = (-2.0, 2.0), (-1.5, 1.5)
WALLS = [
    wall_points(a, b) for a, b in (((-1.98, -1.5), (-1.98, 1.5)), ((-2, -1.48), (2, -1.48)), ((-2, 1.48), (2, 1.48)))
]
LAST_WALL = wall_points((1.98, -1.5), (1.98, 1.5))


def unseen(*clouds: NDArray[np.float32], config: RescueReportConfig = RescueReportConfig()) -> Unseen:
    """The unseen ground in a room with three walls and these clouds."""
    elevation_map = surface_of(*clouds, *WALLS)
    traversability = assess_map(elevation_map)
    reachable = PosePaths(traversability, (-1.5, 0.0)).reachable
    return find_unseen(traversability, elevation_map.measured, reachable, config)


def without(low: float, high: float) -> NDArray[np.float32]:
    """The floor of the room but for a square."""
    points = ground_points(flat, *ROOM)
    return points[~((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1)]


def test_what_was_seen_whole_has_no_rest() -> None:
    seen = unseen(ground_points(flat, *ROOM), LAST_WALL)
    assert seen.places == []
    assert seen.area == 0
    assert seen.seen_fraction == 1
    # All but the cells of the walls.
    assert seen.seen_area == pytest.approx(3.9 * 2.9, abs=0.01)


def test_a_hole_in_the_floor_is_a_place() -> None:
    seen = unseen(without(0, 1), LAST_WALL)
    (place,) = seen.places
    assert place.area == pytest.approx(1, abs=0.01)
    assert place.position == pytest.approx([0.5, 0.5], abs=0.05)
    assert seen.seen_fraction == pytest.approx(1 - 1 / (3.9 * 2.9), abs=0.01)


def test_ground_that_no_robot_can_stand_on_was_seen_but_its_share_is_unknown() -> None:
    elevation_map = surface_of(ground_points(flat, *ROOM), LAST_WALL, *WALLS)
    traversability = assess_map(elevation_map)
    nowhere = np.zeros(traversability.grid.shape, np.bool_)
    seen = find_unseen(traversability, elevation_map.measured, nowhere, RescueReportConfig())
    assert seen.seen_area == pytest.approx(3.9 * 2.9, abs=0.01)
    assert seen.seen_fraction is None


def test_a_small_hole_is_a_patch() -> None:
    seen = unseen(without(0, 0.4), LAST_WALL)
    assert seen.places == []
    assert seen.small_patch_area == pytest.approx(0.16, abs=0.01)


def test_ground_is_expected_ahead_where_no_wall_is() -> None:
    (place,) = unseen(ground_points(flat, *ROOM)).places
    reach = 1.0 - 0.25  # the robot's middle keeps off unknown ground
    assert 2 < place.position[0] < 2 + reach
    assert 2.4 * reach < place.area < 4 * reach  # as wide as the robot's middle can go, or as the room and more


def test_no_ground_is_expected_through_a_gap_in_what_was_seen_of_a_wall() -> None:
    gap = LAST_WALL[np.abs(LAST_WALL[:, 1]) > 0.05]
    assert unseen(ground_points(flat, *ROOM), gap).places == []


def test_no_ground_is_expected_ahead_within_half_a_cell() -> None:
    assert unseen(ground_points(flat, *ROOM), config=RescueReportConfig(expected_extent=0.02)).area == 0
