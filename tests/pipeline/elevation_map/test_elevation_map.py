import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import assess_map
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import Height, flat, ground_points, ramp_and_deck, show, surface_of, wall_points


def column(*heights: float, hits: int = 5) -> np.ndarray:
    return np.array([(0.025, 0.025, z) for z in heights for _ in range(hits)], np.float32)


def test_a_cell_has_the_mean_height_of_its_returns():
    elevation_map = surface_of(np.array([(0.01, 0.01, 0.02), (0.02, 0.04, 0.0), (0.04, 0.02, 0.01)], np.float32))
    assert elevation_map.grid.at(elevation_map.measured, [0.025, 0.025], np.nan) == pytest.approx(0.01, abs=1e-6)


def test_two_returns_are_not_enough():
    elevation_map = surface_of(column(0.0, hits=2))
    assert np.isnan(elevation_map.measured).all()


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ((0.0, 1.5), 0.0),  # a ceiling far above leaves the floor
        ((0.0, 0.5), 0.5),  # a board with too little air under it is what the robot would meet
        ((0.0, 0.1, 0.2, 0.3), 0.3),  # the side of an obstacle up to its top
        ((0.0, 0.1, 0.2, 1.2), 0.2),  # a deck under a lintel
        ((0.04, 0.06), 0.05),  # one floor across the border of two slices
    ],
)
def test_the_lowest_surface_with_headroom_counts(heights, expected):
    elevation_map = surface_of(column(*heights))
    assert elevation_map.grid.at(elevation_map.elevation, [0.025, 0.025]) == pytest.approx(expected, abs=1e-6)


def test_returns_that_stray_into_the_next_slice_do_not_raise_the_ground():
    floor, stray = column(0.105, hits=100), column(0.13, hits=4)
    elevation_map = surface_of(floor, stray)
    assert elevation_map.grid.at(elevation_map.elevation, [0.025, 0.025]) == pytest.approx(0.105, abs=1e-6)
    elevation_map.update(column(0.13, hits=96))  # as many returns as in the bin below are not noise
    assert elevation_map.grid.at(elevation_map.elevation, [0.025, 0.025]) == pytest.approx(0.13, abs=0.013)


def test_it_grows_in_every_direction_without_losing_anything():
    elevation_map = surface_of(ground_points(flat, (0, 1), (0, 1)))
    before = np.isfinite(elevation_map.measured).sum()
    for corner in ((-9, 3), (20, 0), (0, -30)):
        elevation_map.update(column(0.3) + np.array([*corner, 0], np.float32))
        assert elevation_map.grid.at(elevation_map.measured, corner + np.array([0.025, 0.025])) == pytest.approx(0.3)
    assert np.isfinite(elevation_map.measured).sum() == before + 3
    assert elevation_map.grid.at(elevation_map.measured, [0.525, 0.525], np.nan) == 0


@pytest.mark.parametrize("height", [-5.0, 7.0])
def test_the_ground_is_mapped_where_a_slope_has_led_the_robot(height):
    elevation_map = surface_of(ground_points(flat, (0, 1), (0, 1)))
    there = np.array([3.0, 0.0, height], np.float32)
    elevation_map.update(column(0.0) + there, height=height)
    assert elevation_map.grid.at(elevation_map.measured, there[:2] + 0.025) == pytest.approx(height, abs=1e-6)
    with elevation_map.rebuilding(np.array([[there - 1, there + 1]])):
        elevation_map.update(column(0.1) + there, height=height + 0.1)
    assert elevation_map.grid.at(elevation_map.measured, there[:2] + 0.025) == pytest.approx(height + 0.1, abs=1e-6)


def test_no_points_change_nothing():
    elevation_map = ElevationMap(PIONEER)
    elevation_map.update(np.zeros((0, 3), np.float32))
    assert elevation_map.elevation.size == 0


def test_narrow_gaps_are_bridged_and_wide_ones_are_not():
    ground = ground_points(flat, (0, 1), (0, 1))
    narrow = surface_of(ground[(ground[:, 0] < 0.5) | (ground[:, 0] > 0.65)], camera=(-2, 0.5, 0.6))
    wide = surface_of(ground[(ground[:, 0] < 0.5) | (ground[:, 0] > 0.75)], camera=(-2, 0.5, 0.6))
    assert narrow.grid.at(narrow.elevation, [0.575, 0.5], np.nan) == 0
    assert np.isnan(wide.grid.at(wide.elevation, [0.575, 0.5], np.nan))
    assert np.isnan(narrow.grid.at(narrow.measured, [0.575, 0.5], np.nan))


@pytest.mark.parametrize("cameras", [[(-2, 0.5, 0.6), (3, 0.5, 0.6)], [(0.575, -2, 0.6)]])
def test_a_gap_that_no_ray_passed_over_stays_open(cameras):
    """A thin wall stands there that was seen from neither side, or along its face."""
    ground, elevation_map = ground_points(flat, (0, 1), (0, 1)), ElevationMap(PIONEER)
    sides = ground[ground[:, 0] < 0.5], ground[ground[:, 0] > 0.65]
    for camera, points in zip(cameras, sides if len(cameras) > 1 else [np.vstack(sides)], strict=True):
        show(elevation_map, points, camera=np.array(camera))
    assert np.isnan(elevation_map.grid.at(elevation_map.elevation, [0.575, 0.5], np.nan))


def test_a_gap_is_filled_by_a_later_ray_to_ground_behind_it():
    ground, camera = ground_points(flat, (0, 1), (0, 1)), np.array([-2, 0.5, 0.6])
    elevation_map = surface_of(ground[(ground[:, 0] < 0.5) | (ground[:, 0] > 0.65)])
    show(elevation_map, ground[ground[:, 0] > 0.95], camera=camera)
    assert elevation_map.grid.at(elevation_map.elevation, [0.575, 0.5], np.nan) == 0


def with_pocket(length: float, height: Height = flat) -> ElevationMap:
    """Ground shown by four keyframes that end at a pocket 0.1 m wide and ``length`` m long: no ray passes over it."""
    x, y = (-0.1, 0.0), (-length, 0.0)
    around = [((-1, x[0]), (-1, 1)), ((x[1], 1), (-1, 1)), (x, (-1, y[0])), (x, (y[1], 1))]
    cameras = [(-2, 0, 0.6), (2, 0, 0.6), (0, -2, 0.6), (0, 2, 0.6)]
    elevation_map = ElevationMap(PIONEER)
    for part, camera in zip(around, cameras, strict=True):
        show(elevation_map, ground_points(height, *part), camera=np.array(camera))
    assert (elevation_map.grid.at(elevation_map.layers["ceiling"], [-0.05, -0.05]) == np.inf).all()
    return elevation_map


def step_beside(x, y):
    """Ground that is 0.08 m higher where x is positive."""
    return np.where(x > 0, 0.08, 0.0)


def test_a_pocket_too_small_for_a_wheel_does_not_bar_the_ground_around_it():
    elevation_map = with_pocket(0.15)
    assert elevation_map.grid.at(elevation_map.elevation, [-0.05, -0.05], np.nan) == 0
    assert np.isnan(elevation_map.grid.at(elevation_map.measured, [-0.05, -0.05], np.nan))
    ground = assess_map(elevation_map)
    assert ground.grid.at(ground.traversable, [-0.05, -0.05])


@pytest.mark.parametrize(("length", "height"), [(0.2, flat), (0.15, step_beside)])
def test_a_pocket_that_may_hold_a_wheel_or_a_wall_stays_unknown(length, height):
    elevation_map = with_pocket(length, height)
    assert np.isnan(elevation_map.grid.at(elevation_map.elevation, [-0.05, -0.05], np.nan))


def test_a_pocket_with_a_dropout_stays_unknown():
    elevation_map = with_pocket(0.15)
    post = ground_points(flat, (-0.1, -0.05), (-0.05, 0.0))
    show(elevation_map, ground_points(flat, (-1, -0.5), (-1, 1)), post, camera=np.array([-2.0, 0.0, 0.6]))
    assert np.isnan(elevation_map.grid.at(elevation_map.elevation, [[-0.075, -0.025], [-0.025, -0.1]], np.nan)).all()


STRIPE = ground_points(flat, (-1, 1), (-0.01, 0.01))
"""The ground that drops out behind a panel along the x axis that is seen along this axis."""


def seen_along_a_panel(hidden: float = 0.01) -> ElevationMap:
    """``hidden``: half the width of the stripe without returns, m; if the stripe fills cells, they stay unknown."""
    elevation_map, ground = ElevationMap(PIONEER), ground_points(flat, (-1, 1), (-1, 1))
    stripe = ground_points(flat, (-1, 1), (-hidden, hidden))
    show(elevation_map, ground[np.abs(ground[:, 1]) > hidden], stripe, camera=np.array([-2.0, 0.0, 0.6]))
    return elevation_map


def test_where_ground_drops_out_it_is_unknown_whatever_the_returns():
    elevation_map = seen_along_a_panel()
    for layer in (elevation_map.measured, elevation_map.elevation):
        assert np.isnan(elevation_map.grid.at(layer, [(0.0, -0.005), (0.0, 0.005)], np.nan)).all()
    # The cells beside the axis dropped out; they are not bridged from their neighbours.
    assert elevation_map.grid.at(elevation_map.dropout, [(0.5, 0.005), (0.5, -0.005)]).all()
    assert elevation_map.grid.at(elevation_map.elevation, [0.0, 0.06], np.nan) == 0


@pytest.mark.parametrize(("camera", "is_cleared"), [((0.0, -2.0, 0.6), True), ((-2.0, -0.3, 0.6), False)])
def test_a_dropout_is_cleared_by_a_keyframe_from_another_side(camera, is_cleared):
    elevation_map = seen_along_a_panel()
    show(elevation_map, ground_points(flat, (-1, 1), (-1, 1)), np.zeros((0, 3), np.float32), camera=np.array(camera))
    assert np.isfinite(elevation_map.grid.at(elevation_map.elevation, [0.0, 0.005], np.nan)) == is_cleared


@pytest.mark.parametrize("hidden", [0.01, 0.06])
@pytest.mark.parametrize(("distance", "is_cleared"), [(2.0, True), (1.0, False)])
def test_a_dropout_is_cleared_from_any_side_by_as_many_returns_as_its_cell_has_pixels(distance, is_cleared, hidden):
    """From nearer by, a cell has more pixels, so the same number of returns does not fill it."""
    elevation_map, ground = seen_along_a_panel(hidden), ground_points(flat, (-1, 1), (-1, 1))
    elevation_map.update(ground, np.full(len(ground), 3, np.uint8), camera=np.array([-distance, 0.0, 0.6]))
    assert np.isfinite(elevation_map.grid.at(elevation_map.elevation, [0.0, 0.005], np.nan)) == is_cleared


def test_a_single_cell_with_a_dropout_is_not_bridged():
    elevation_map, cell = (
        ElevationMap(PIONEER),
        STRIPE[np.abs(STRIPE[:, 0] - 0.025) < 0.024] + np.float32([0, 0.025, 0]),
    )
    show(elevation_map, ground_points(flat, (-1, 1), (-1, 1)), cell, camera=np.array([-2.0, 0.0, 0.6]))
    assert elevation_map.dropout.sum() == 1
    assert np.isnan(elevation_map.grid.at(elevation_map.elevation, [0.025, 0.025], np.nan))


def test_no_gap_is_bridged_across_a_dropout():
    ground = ground_points(flat, (-1, 1), (-1, 1))
    gap = ground[np.abs(ground[:, 1] - 0.025) > 0.075]
    bridged, open_gap = surface_of(gap, camera=(0, -3, 0.6)), ElevationMap(PIONEER)
    show(open_gap, gap, STRIPE + np.float32([0, 0.025, 0]), camera=np.array([0, -3, 0.6]))
    assert bridged.grid.at(bridged.elevation, [0.0, 0.06], np.nan) == 0
    assert np.isnan(open_gap.grid.at(open_gap.elevation, [0.0, 0.06], np.nan))


def test_a_dropout_above_or_below_the_ground_does_not_count():
    elevation_map = ElevationMap(PIONEER)
    high = STRIPE + np.float32([0, 0, 0.3])
    show(elevation_map, ground_points(flat, (-1, 1), (-1, 1)), high, camera=np.array([-2.0, 0.0, 0.6]))
    assert not elevation_map.dropout.any()


def test_a_felt_obstacle_stays_whatever_is_seen():
    elevation_map = surface_of(ground_points(flat, (-1, 1), (-1, 1)))
    elevation_map.add_obstacle(np.array([(0.5, 0.0, 0.3)]))
    elevation_map.update(ground_points(flat, (-1, 1), (-1, 1)))
    assert elevation_map.grid.at(elevation_map.elevation, [0.5, 0.0]) == pytest.approx(0.3)
    assert elevation_map.grid.at(elevation_map.measured, [0.5, 0.0]) == pytest.approx(0.3)
    assert elevation_map.grid.at(elevation_map.elevation, [0.4, 0.0]) == 0


def test_a_gap_between_different_heights_stays_open():
    ground = ground_points(ramp_and_deck, (1, 2), (-1, 1))
    elevation_map = surface_of(ground[np.abs(ground[:, 1] - 0.6) > 0.05])
    assert np.isnan(elevation_map.grid.at(elevation_map.elevation, [1.5, 0.625], np.nan))


def test_assumed_ground_gives_way_to_returns():
    elevation_map = ElevationMap(PIONEER)
    elevation_map.assume_ground(ground_points(flat, (0.5, 1.5), (1.5, 3.4)))
    at = elevation_map.grid.at
    assert at(elevation_map.elevation, [1.0, 3.3], np.nan) == 0
    assert at(elevation_map.elevation, [0.6, 2.0], np.nan) == 0
    assert np.isnan(at(elevation_map.elevation, [1.0, 1.3], np.nan))
    assert np.isnan(elevation_map.measured).all()
    elevation_map.update(wall_points((0.5, 3.0), (1.5, 3.0)))
    assert elevation_map.grid.at(elevation_map.elevation, [1.0, 3.0]) > 1


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-3, 3, width=32)] * 2, st.floats(-0.5, 2, width=32)), min_size=1, max_size=60),
    st.randoms(),
)
def test_order_of_points_does_not_matter(points, random):
    shuffled = points.copy()
    random.shuffle(shuffled)
    a, b = (surface_of(np.repeat(np.array(p, np.float32), 3, axis=0)) for p in (points, shuffled))
    np.testing.assert_allclose(a.measured, b.measured, atol=1e-5)


def test_where_the_robot_has_been_no_panel_stands():
    panel = np.array([[0.025, y, 0.0] for y in np.arange(-0.975, 1.0, 0.05)], np.float32).repeat(60, axis=0)
    camera = np.array([-2.0, 0.0, 0.6])
    for comes_first in (True, False):
        world = surface_of(ground_points(flat, (-2, 2), (-1, 1)))
        if comes_first:
            show(world, ground_points(flat, (1.5, 1.6), (0, 0.1)), panel, camera=camera)
        world.add_track(np.array([[x, 0.0, 0.0] for x in np.arange(-0.5, 0.5, 0.04)]))
        if not comes_first:
            show(world, ground_points(flat, (1.5, 1.6), (0, 0.1)), panel, camera=camera)
        assert world.grid.at(world.dropout, (0.025, 0.5))
        assert not world.grid.at(world.dropout, [(0.025, y) for y in (-0.15, 0.0, 0.15)]).any()
        assert world.grid.at(world.elevation, (0.025, 0.0), outside=np.nan) == 0.0


def test_only_what_lies_within_boxes_is_rebuilt():
    ground = ground_points(flat, (-1, 1), (-1, 1))
    elevation_map, box = surface_of(ground), np.array([[(0.0, -0.5), (0.5, 0.5)]])
    with elevation_map.rebuilding(box) as meets:
        others = np.array([[(-1.0, -1.0), (-0.06, 1.0)], [(0.4, 0.4), (9.0, 9.0)], [(8.0, 8.0), (9.0, 9.0)]])
        assert meets(others).tolist() == [False, True, False]
        elevation_map.update(ground + np.float32([0, 0, 0.2]))
    at = elevation_map.grid.at(elevation_map.measured, [(0.2, 0.2), (-0.2, 0.2), (0.2, 0.7)], np.nan)
    assert at == pytest.approx([0.2, 0.0, 0.0], abs=1e-6)
