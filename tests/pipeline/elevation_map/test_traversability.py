from dataclasses import replace

import numpy as np
import pytest

from pipeline.elevation_map import pose_kernels
from pipeline.elevation_map.config import ElevationConfig, PathCosts, TraversabilityConfig
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import assess_map
from pipeline.errors import InputError
from pipeline.planning.pose_paths import PosePaths
from pipeline.transforms import are_poses, yaw_of
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import RUN, flat, ground_points, ramp_and_deck, ridge, show, surface_of, wall_points


def test_the_unknown_may_be_a_wall_that_sends_nothing_back():
    at = (traversability := assess_map(surface_of(ground_points(flat, (0, 2), (0, 2))))).grid.at
    assert at(traversability.traversable, [1.0, 1.0])
    assert at(traversability.traversable, [0.28, 1.0])
    assert not at(traversability.traversable, [0.24, 1.0])
    assert not at(traversability.traversable, [-5.0, 1.0])


def test_it_keeps_away_from_walls_and_further_for_turning():
    world = surface_of(ground_points(flat, (-1, 2), (-2, 2)), wall_points((1.0, -2), (1.0, 2)))
    traversability = assess_map(world)
    assert not traversability.grid.at(traversability.traversable, [0.76, 0.0])
    assert traversability.grid.at(traversability.traversable, [0.66, 0.0])
    assert not traversability.grid.at(traversability.turnable, [0.66, 0.0])
    assert traversability.grid.at(traversability.turnable, [0.55, 0.0])


def test_it_keeps_off_a_hand_on_the_floor_but_can_leave_from_where_it_has_been():
    ground = assess_map(surface_of(ground_points(flat, (-2, 2), (-1, 1))))
    hand, nowhere = np.array([[0.0, 0.3, 0.02]]), np.zeros(ground.grid.shape, np.bool_)
    at, kept = ground.grid.at, ground.keeping_off(hand, nowhere)
    beside = [0.0, 0.3 - 0.2 - PIONEER.half_width]  # heading along x, its side 0.2 m from the hand
    assert at(ground.traversable, beside)
    assert not at(kept.free[..., 0] & 1, beside)
    assert at(kept.free[..., 0] & 1, [0.0, beside[1] - 0.1])
    assert at(kept.hazard, [0.0, 0.15]) and not at(kept.hazard, [0.0, 0.05])
    np.testing.assert_array_equal(kept.clearance[0], ground.clearance[0])  # far away
    been = ground.grid.distance_to(ground.grid.mask_of([[0.0, 0.0]])) < 0.5
    assert at(ground.keeping_off(hand, been).traversable, [0.0, 0.0])


@pytest.mark.parametrize("y", [1.5, 3.5])  # the second person is on unknown ground
def test_near_people_it_plans_to_drive_as_slowly_as_it_is_allowed_to(y):
    ground = assess_map(surface_of(ground_points(flat, (-3, 3), (-3, 3))))
    person, nowhere = np.array([[0.0, y, 0.1]]), np.zeros(ground.grid.shape, np.bool_)
    kept = ground.keeping_off(person, nowhere, beside_people=1.0, speed_near_people=0.05)
    for away, is_slow in ((0.9, True), (1.2, False)):
        a, b = np.array([[-0.1, y - away], [0.1, y - away]])
        usual = ground.line_seconds([a], [b])[0], PosePaths(ground, a, 0.0).seconds_at(b, 0)
        expected = (0.2 / 0.05, 0.2 / 0.05) if is_slow else usual
        assert (kept.line_seconds([a], [b])[0], PosePaths(kept, a, 0.0).seconds_at(b, 0)) == pytest.approx(expected)


@pytest.mark.parametrize(("height", "is_hazard"), [(0.05, True), (0.02, False)])
def test_it_keeps_away_from_the_lowest_step_of_a_step_field(height, is_hazard):
    block = ground_points(lambda x, y: 0 * x + height, (0, 0.5), (0, 0.5))
    around = ground_points(flat, (-1, 1.5), (-1, 1.5))
    outside = (np.abs(around[:, :2] - 0.25) > 0.25).any(axis=1)
    traversability = assess_map(surface_of(block, around[outside]))
    assert traversability.grid.at(traversability.hazard, [0.025, 0.275]) == is_hazard
    assert traversability.grid.at(traversability.traversable, [-0.1, 0.275]) != is_hazard


@pytest.mark.parametrize("along", [0.0, np.pi / 4])
@pytest.mark.parametrize(("step", "is_hazard"), [(0.015, False), (-0.03, False), (0.06, True), (-0.06, True)])
def test_a_step_on_a_slope_is_what_the_slope_does_not_explain(along, step, is_hazard):
    def slope(x, y):
        up = np.cos(along) * x + np.sin(along) * y
        return np.tan(np.deg2rad(15)) * up + np.where(up > -1e-6, step, 0)

    traversability = assess_map(surface_of(ground_points(slope, (-1, 1), (-1, 1))))
    x, y = np.meshgrid(np.arange(-0.475, 0.5, 0.05), np.arange(-0.475, 0.5, 0.05))
    assert traversability.grid.at(traversability.hazard, np.column_stack([x.ravel(), y.ravel()])).any() == is_hazard


@pytest.mark.parametrize("height", [0.05, 0.08, 0.12])
def test_a_block_that_ends_within_a_cell_is_a_hazard_up_to_its_edge(height):
    ground = ground_points(flat, (-1, 1), (-1, 1))
    block = ground_points(lambda x, y: 0 * x + height, (0.02, 0.5), (-0.5, 0.5))
    face = wall_points((0.02, -0.5), (0.02, 0.5), height)
    outside = (ground[:, 0] < 0.02) | (np.abs(ground[:, 1]) > 0.5)
    traversability = assess_map(surface_of(ground[outside], block, face))
    assert traversability.grid.at(traversability.hazard, [(0.025, y) for y in np.arange(-0.475, 0.5, 0.05)]).all()


@pytest.mark.parametrize("height", [0.08, 0.1, 0.13, 0.3])
def test_the_floor_beside_a_block_is_no_slope(height):
    ground = assess_map(surface_of(ground_points(lambda x, y: np.where(x > 0, height, 0.0), (-1, 1), (-1, 1))))
    assert ground.grid.at(ground.hazard, [0.025, 0.025])
    assert not ground.grid.at(ground.hazard, [(-0.025, 0.025), (-0.075, 0.025), (-0.125, 0.025)]).any()


def test_corners_clear_a_post_when_the_robot_turns_a_little_beside_its_way_point():
    post = np.repeat(np.array([(0.025, 0.025, z) for z in (0.1, 0.2, 0.3)], np.float32), 5, axis=0)
    traversability = assess_map(surface_of(ground_points(flat, (-1, 1), (-1, 1)), post))
    assert not traversability.grid.at(traversability.turnable, [0.225, 0.325])  # 0.36 m away
    assert traversability.grid.at(traversability.turnable, [0.325, 0.325])


def drives(traversability, start, end):
    """Whether a straight drive between two points (2,) meets no obstacle."""
    return bool(np.isfinite(traversability.line_seconds([start], [end])[0]))


def test_room_is_measured_from_the_footprint_by_its_heading():
    traversability = assess_map(
        surface_of(ground_points(flat, (-2, 2), (-2, 2)), wall_points((1.025, -2), (1.025, 2)))
    )
    at = traversability.clearance[tuple(traversability.grid.cell_of((0.625, 0.0)))]
    assert at[0] == pytest.approx(100 * (0.4 - PIONEER.half_length), abs=1)
    assert at[4] == pytest.approx(100 * (0.4 - PIONEER.half_width), abs=1)
    assert at[2] == pytest.approx(100 * (0.4 - PIONEER.corner_radius), abs=1)
    inside = traversability.clearance[tuple(traversability.grid.cell_of((1.025, 0.0)))]
    assert (inside < -20).all()


def test_uphill_is_the_gradient_of_the_ramp():
    traversability = assess_map(surface_of(ground_points(ridge, (-2, 2), (-1, 1))))
    for x, slope in ((-0.3, 0.287), (0.3, -0.287), (-1.5, 0.0)):
        np.testing.assert_allclose(traversability.grid.at(traversability.uphill, (x, 0)), (slope, 0), atol=0.02)
    before = traversability.grid.at(traversability.uphill, (-RUN - 0.1, 0))
    assert before[0] > 0.1
    assert abs(before[1]) < 0.01


@pytest.mark.parametrize("heading", [-2.0, 0.0, 0.7, np.pi / 2])
def test_a_robot_that_stands_on_a_ramp_is_tilted_with_it_and_keeps_its_heading(heading):
    ground = assess_map(surface_of(ground_points(ridge, (-2.5, 2.5), (-1, 1))))
    position = np.array([-RUN / 2, 0.1])
    T = ground.pose_on_ground(position, heading)
    slope = ridge(*position) / (RUN / 2)
    assert are_poses(T)
    assert yaw_of(T) == pytest.approx(heading)
    np.testing.assert_allclose(T[:3, 3], [*position, ridge(*position)], atol=0.01)
    np.testing.assert_allclose(T[:3, 2], np.array([-slope, 0, 1]) / np.hypot(slope, 1), atol=0.02)


def test_a_ramp_is_near_within_the_margin():
    traversability = assess_map(surface_of(ground_points(ridge, (-2, 2), (-1, 1))))
    assert traversability.has_ramp((0.3, 0.0))
    assert traversability.has_ramp((-RUN - 0.1, 0.0))
    assert not traversability.has_ramp((-RUN - 0.3, 0.0))


def test_where_the_robot_has_driven_it_may_drive_again():
    corridor = surface_of(
        ground_points(flat, (-1, 1), (-0.5, 0.5)), *(wall_points((-1, y), (1, y)) for y in (-0.33, 0.33))
    )
    assert drives(assess_map(corridor), (-0.6, 0.02), (0.6, 0.02))
    corridor.update(wall_points((0, -0.22), (0.05, -0.22)))  # a chair leg, or noise
    assert not drives(assess_map(corridor), (-0.6, 0.02), (0.6, 0.02))
    corridor.add_track(np.column_stack([np.linspace(-0.6, 0.6, 50), np.full(50, 0.02), np.zeros(50)]))
    assert drives(assess_map(corridor), (-0.6, 0.02), (0.6, 0.02))
    corridor.update(wall_points((0, -0.17), (0.05, -0.17)))  # in the robot's way
    assert not drives(assess_map(corridor), (-0.6, 0.02), (0.6, 0.02))


def test_a_gap_that_the_robot_has_passed_and_that_drift_makes_narrower_lets_it_back():
    walls = [wall_points((-0.2, y), (0.2, y)) for y in (-0.18, 0.18)]  # 7 cm inside the footprint on each side
    gap, there, back = surface_of(ground_points(flat, (-1.5, 1.5), (-0.5, 0.5)), *walls), (-1.0, 0.0), (1.0, 0.0)
    track = np.column_stack([np.linspace(-1, 1, 80), np.zeros(80), np.zeros(80)])
    assert np.isinf(PosePaths(assess_map(gap), there, 0.0).cost_to(back))
    gap.add_track(track)
    assert np.isfinite(PosePaths(assess_map(gap), there, 0.0).cost_to(back))
    across = pose_kernels.HEADINGS // 4
    middle = gap.grid.cell_of((0.0, 0.0))
    assert not assess_map(gap).free[(*middle, 0)] >> across & 1  # it never stood there across
    gap.forget_track(np.array([(0.0, 0.1, 0.2)]))  # something stood in its way since
    assert np.isinf(PosePaths(assess_map(gap), there, 0.0).cost_to(back))
    gap.add_track(track)
    assert np.isfinite(PosePaths(assess_map(gap), there, 0.0).cost_to(back))
    gap.update(wall_points((-0.05, 0.05), (0.05, 0.05)))  # no drift moves a wall that far
    assert np.isinf(PosePaths(assess_map(gap), there, 0.0).cost_to(back))


def test_people_far_from_a_gap_that_the_robot_has_passed_do_not_close_it():
    walls = [wall_points((-0.2, y), (0.2, y)) for y in (-0.18, 0.18)]
    gap = surface_of(ground_points(flat, (-1.5, 1.5), (-0.5, 0.5)), *walls)
    gap.add_track(np.column_stack([np.linspace(-1, 1, 80), np.zeros(80), np.zeros(80)]))
    ground = assess_map(gap)
    kept = ground.keeping_off(np.array([(-1.4, -0.4), (1.4, 0.4)]), np.zeros(ground.grid.shape, np.bool_))
    assert kept.kept_off.any()
    middle = tuple(ground.grid.cell_of((0.0, 0.0)))
    assert ground.free[middle][0] & 1
    np.testing.assert_array_equal(kept.free[middle], ground.free[middle])


def test_successive_headings_in_one_cell_are_a_turn():
    same, angles = np.zeros((3, 2), np.int64), pose_kernels.HEADING_ANGLES
    bits = pose_kernels.heading_bits(same, np.array([angles[0], angles[1] + 0.05, angles[1] + np.pi]))
    assert bits.tolist() == [1, 1 << 1 | 1 << 8, 1 << 1]
    apart = np.array([[0, 0], [0, 1], [1, 1]])
    assert pose_kernels.heading_bits(apart, angles[:3]).tolist() == [1, 2, 4]


def test_ground_that_lies_lower_behind_a_gap_is_a_drop():
    deck = np.vstack(
        [ground_points(lambda x, y: 0 * x + 0.34, (0, 1), (-1, 1)), ground_points(flat, (1.4, 2.4), (-1, 1))]
    )
    traversability = assess_map(surface_of(deck))
    at = traversability.grid.at
    assert at(traversability.hazard, [0.975, 0.0])
    assert not at(traversability.hazard, [1.425, 0.0])
    assert not at(traversability.traversable, [0.72, 0.0])
    assert at(traversability.traversable, [0.62, 0.0])


def test_the_far_foot_of_an_unseen_slope_is_none():
    ground = ground_points(ridge, (-2, 2), (-1, 1))
    traversability = assess_map(surface_of(ground[(ground[:, 0] < 0) | (ground[:, 0] > RUN)]))
    assert not traversability.hazard.any()


def test_the_robot_turns_neither_on_a_ramp_nor_right_before_it():
    traversability = assess_map(surface_of(ground_points(ridge, (-2, 2), (-1, 1))))
    assert not traversability.grid.at(traversability.turnable, [-0.3, 0])
    assert not traversability.grid.at(traversability.turnable, [-RUN - 0.1, 0])
    assert traversability.grid.at(traversability.turnable, [-RUN - 0.4, 0])


@pytest.mark.parametrize("start", [(1.2, 0.0), (1.2, 1.2)])
def test_the_side_of_a_deck_is_no_way_up_or_down(start):
    traversability = assess_map(surface_of(ground_points(ramp_and_deck, (-2, 2), (-2, 2))))
    other_side = (start[0], 1.2 - start[1])
    assert not drives(traversability, start, other_side)
    assert traversability.grid.at(traversability.traversable, [1.2, 0.25])
    assert not traversability.grid.at(traversability.traversable, [1.2, 0.4])
    assert not traversability.grid.at(traversability.traversable, [1.2, 0.8])


def test_downhill_there_is_room_to_lean_and_in_turns_to_slide():
    slope, wall = 0.28, 1.2
    walls = [wall_points((-2, y), (2, y)) for y in (-wall, wall)]
    traversability = assess_map(surface_of(ground_points(lambda x, y: slope * y, (-2, 2), (-1.5, 1.5)), *walls))
    column = traversability.free[traversability.grid.cell_of((0.0, 0.0))[0]]
    lean, slide = slope * PIONEER.body_height / 2, slope * PIONEER.ramp_slide / np.tan(PIONEER.max_tilt)
    for turns, downhill in ((0, lean), (1, lean + slide)):
        y = np.array([traversability.grid.centre_of((0, j))[1] for j in np.flatnonzero(column[:, turns] & 1)])
        off = (y.min() + wall) - (wall - y.max())
        assert off == pytest.approx(downhill, abs=traversability.grid.cell)
    relaxed = traversability.without_downhill_room
    assert np.count_nonzero(relaxed.free[..., 1]) > np.count_nonzero(traversability.free[..., 1])
    is_raised = relaxed.clearance > traversability.clearance
    assert (relaxed.clearance <= relaxed.required_clearance[..., None])[is_raised].all()
    beside = np.array([[0.0, 0.05 - wall + PIONEER.half_width, 0.0]])
    assert relaxed.pose_clearances(beside)[0] > 0 > traversability.pose_clearances(beside)[0]


def test_where_it_drove_beside_a_wall_downhill_it_may_drive_again():
    slope, wall = 0.28, -1.2
    ramp = surface_of(ground_points(lambda x, y: slope * y, (-1, 1), (-1.3, 0)), wall_points((-1, wall), (1, wall)))
    y = wall + PIONEER.half_width + 0.04
    assert not drives(assess_map(ramp), (-0.5, y), (0.5, y))
    ramp.add_track(np.column_stack([np.linspace(-0.5, 0.5, 50), np.full(50, y), np.zeros(50)]))
    assert drives(assess_map(ramp), (-0.5, y), (0.5, y))


def test_a_slope_beyond_twenty_degrees_is_a_hazard():
    gentle = surface_of(ground_points(lambda x, y: x * np.tan(np.deg2rad(18)), (0, 2), (0, 2)))
    steep = surface_of(ground_points(lambda x, y: x * np.tan(np.deg2rad(22)), (0, 2), (0, 2)))
    gentle, steep = assess_map(gentle), assess_map(steep)
    assert not gentle.grid.at(gentle.hazard, [1.0, 1.0])
    assert steep.grid.at(steep.hazard, [1.0, 1.0])


def test_it_keeps_away_from_where_a_panel_may_stand():
    world, ground = ElevationMap(PIONEER), ground_points(flat, (-1, 1), (-1, 1))
    show(world, ground, ground_points(flat, (-1, 1), (0.01, 0.03)), camera=np.array([-2.0, 0.0]))
    traversability = assess_map(world)
    assert not traversability.grid.at(traversability.traversable, [0.0, 0.28])
    assert traversability.grid.at(traversability.traversable, [0.0, 0.38])
    assert not drives(traversability, (0.0, -0.5), (0.0, 0.5))


@pytest.mark.parametrize("far", [{"width": 2.0}, {"length": 1.7}, {"width": np.nan}])
def test_clearances_beyond_what_is_distinguished_are_refused(far):
    world = ElevationMap(replace(PIONEER, **far))
    world.update(ground_points(flat, (-1, 1), (-1, 1)))
    with pytest.raises(InputError, match="at most 1 m"):
        assess_map(world)


def test_a_wider_robot_keeps_further_away():
    cloud = [ground_points(flat, (-1, 2), (-2, 2)), wall_points((0.98, -2), (0.98, 2))]
    narrow, wide = ElevationMap(PIONEER), ElevationMap(replace(PIONEER, width=0.8))
    for world, room in ((narrow, 40 - 25), (wide, 40 - 40)):
        world.update(np.vstack(cloud))
        traversability = assess_map(world)
        beside = traversability.clearance[tuple(traversability.grid.cell_of((0.575, 0.0)))][4]
        assert beside == pytest.approx(room, abs=1)


def passage(width, right):
    """Ground with a passage along x, 1 m long, between walls at y = ``right`` and ``width`` m to the left of it."""
    left, ground = right + width, ground_points(flat, (-1, 2), (-1, 1.5))
    beside = (ground[:, 0] > 0) & (ground[:, 0] < 1) & ((ground[:, 1] < right) | (ground[:, 1] > left))
    walls = [wall_points((0, y), (1, y)) for y in (right, left)]
    fronts = [wall_points((x, a), (x, b)) for x in (0, 1) for a, b in ((-1, right), (left, 1.5))]
    return assess_map(surface_of(ground[~beside], *walls, *fronts)), right + width / 2


@pytest.mark.parametrize("right", [0.001, 0.017, 0.041])
def test_without_margin_a_passage_two_cells_wider_than_the_robot_is_passable_wherever_it_lies(right):
    ground, middle = passage(PIONEER.width + 0.1, right)
    way = PosePaths(ground.without_margin, (-0.6, middle)).cost_to((1.6, middle))
    assert np.isfinite(way)
    assert ground.without_margin.ignores_margin and not ground.ignores_margin
    assert (ground.free & ~ground.without_margin.free == 0).all()


@pytest.mark.parametrize("right", [0.001, 0.017, 0.041])
def test_without_margin_what_is_narrower_than_the_robot_stays_impassable(right):
    ground, middle = passage(PIONEER.width - 0.06, right)
    assert np.isinf(PosePaths(ground.without_margin, (-0.6, middle)).cost_to((1.6, middle)))


def test_a_passage_that_needs_no_daring_is_the_same_without_margin():
    ground, middle = passage(1.2, 0.01)
    ways = [PosePaths(g, (-0.6, middle)).path_to((1.6, middle)) for g in (ground, ground.without_margin)]
    np.testing.assert_array_equal(*ways)


def test_other_numbers_hold_in_the_map_on_the_ground_and_for_the_way():
    clouds = ground_points(flat, (-2, 2), (-2, 2)), wall_points((0, -2), (0, 0.4))
    costs = PathCosts(bend=3.0, narrow_stopping_distance=0.02)
    world = ElevationMap(PIONEER, ElevationConfig(cell=0.1, traversability=TraversabilityConfig(costs=costs)))
    world.update(np.vstack(clouds))
    slow, usual = (PosePaths(assess_map(w), (-1.0, -1.0), 0.0) for w in (world, surface_of(*clouds)))
    assert slow.traversability.grid.cell == 0.1
    assert slow.straightened_path_to((1.0, -1.0)).places[:, 1].max() > 0.4  # around the end of the wall
    assert np.isfinite(slow.cost_to((1.0, -1.0))) and np.isfinite(usual.cost_to((1.0, -1.0)))
    beside = (np.array([[-0.35, -1.0]]), np.array([[-0.35, 0.0]]))
    assert slow.traversability.line_seconds(*beside) > usual.traversability.line_seconds(*beside)
