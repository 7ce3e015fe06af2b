"""Cheapest ways over poses: what a Pioneer can do, and what holds for every way."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.elevation_map import pose_kernels
from pipeline.elevation_map.config import TraversabilityConfig
from pipeline.elevation_map.traversability import assess, assess_map
from pipeline.grid_map import Grid
from pipeline.planning import pose_paths_kernels as kernels
from pipeline.planning.pose_paths import PosePaths, heading_mask, nearest_heading, simplify
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import flat, ground_points, ramp_and_deck, ridge, surface_of, wall_points

EAST, NORTH, WEST = 0.0, np.pi / 2, np.pi
CONFIG = TraversabilityConfig()


@pytest.fixture(scope="module")
def maze():
    """A wall from the south edge up to y = 0.6 between two halves of a square."""
    return assess_map(surface_of(ground_points(flat, (-2, 2), (-2, 2)), wall_points((0, -2), (0, 0.6))))


def corridor(half_width, ground=flat, length=2.0):
    """Along x, closed by a wall in the east."""
    walls = [wall_points((-length, y), (length, y)) for y in (-half_width, half_width)]
    end = wall_points((length, -half_width), (length, half_width))
    return assess_map(surface_of(ground_points(ground, (-length, length), (-half_width, half_width)), *walls, end))


def scattered(blocks):
    """Ground of 2 m × 2 m on which (N, 2) cells are walls."""
    elevation = np.zeros((40, 40), np.float32)
    elevation[tuple(blocks.T)] = 1.0
    nowhere = np.zeros(elevation.shape, np.bool_)
    return assess(
        Grid(np.zeros(2, np.int64), 0.05, elevation.shape),
        elevation,
        nowhere,
        nowhere.astype(np.uint16),
        PIONEER,
        CONFIG,
    )


def stands_in(traversability):
    """(nx, ny, 16) where enough room is left around the robot with each heading."""
    return heading_mask(traversability.free[..., 0].astype(np.uint16) * 257)


def graph_of(traversability):
    """The graph of all poses that may be entered, and of all moves between them."""
    graph, terrain, costs = nx.DiGraph(), traversability.terrain, traversability.costs()
    stands, level = stands_in(traversability), kernels.level_ticks(terrain.cell, costs)
    for i, j, h in np.argwhere(stands).tolist():
        for move in kernels.Move:
            there = kernels.move_from(i, j, h, move)
            if all(0 <= k < n for k, n in zip(there, stands.shape, strict=True)) and stands[there]:
                pose = (i, j, h)
                ticks = kernels.entry_ticks(*pose, *there, move, pose, terrain, level, costs, -1)
                if ticks > 0:
                    graph.add_edge(pose, there, weight=ticks)
    return graph


def test_it_agrees_with_networkx():
    traversability = scattered(np.array([(20, j) for j in range(14)]))
    paths = PosePaths(traversability, (0.6, 0.6), EAST)
    first = (*traversability.grid.cell_of((0.6, 0.6)).tolist(), 0)
    expected = nx.single_source_dijkstra_path_length(graph_of(traversability), first)
    assert len(expected) > 1000
    for pose, ticks in expected.items():
        assert paths.seconds[pose] == pytest.approx(ticks * 0.01, rel=1e-5)
    assert np.isfinite(paths.seconds).sum() == len(expected)


@settings(max_examples=25, deadline=None)
@given(arrays(np.int64, (4, 2), elements=st.integers(0, 39)), st.integers(0, 15))
def test_no_way_leads_where_there_is_no_room(blocks, heading):
    traversability = scattered(blocks)
    start = np.array([1.025, 1.025])
    paths = PosePaths(traversability, start, float(pose_kernels.HEADING_ANGLES[heading]))
    cells = np.argwhere(np.isfinite(paths.seconds) & ~stands_in(traversability))
    assert (np.abs(traversability.grid.centre_of(cells[:, :2]) - start) < 2 * PIONEER.corner_radius + 0.1).all()
    for cell in np.argwhere(paths.reachable)[::97]:
        goal = traversability.grid.centre_of(cell)
        way = paths.straightened_path_to(goal)
        np.testing.assert_allclose(way.places[-1], goal)
        if stands_in(traversability)[tuple(traversability.grid.cell_of(start))].all():
            line = np.vstack([start, way.places])
            moved = np.linalg.norm(np.diff(line, axis=0), axis=1) > 0
            assert np.isfinite(traversability.line_seconds(line[:-1], line[1:])[moved]).all()


@settings(max_examples=25, deadline=None)
@given(arrays(np.int64, (5, 2), elements=st.integers(0, 39)), st.integers(0, 15), st.floats(0.5, 30.0))
def test_a_search_up_to_a_horizon_gives_the_same_as_a_whole_one(blocks, heading, horizon):
    traversability = scattered(blocks)
    start = (1.025, 1.025), float(pose_kernels.HEADING_ANGLES[heading])
    whole, part = PosePaths(traversability, *start), PosePaths(traversability, *start)
    cells = np.argwhere(np.ones((40, 40), np.bool_))
    near = part.seconds_to(cells, horizon).reshape(40, 40, 16)
    is_near = whole.seconds < horizon
    np.testing.assert_array_equal(near[is_near], whole.seconds[is_near])
    assert (near[~is_near] >= horizon - 2 * 0.01).all()
    np.testing.assert_array_equal(part.seconds, whole.seconds)


@settings(max_examples=25, deadline=None)
@given(arrays(np.int64, (6, 2), elements=st.integers(0, 39)), st.integers(0, 15))
def test_the_poses_named_before_the_search_are_those_that_it_reaches(blocks, heading):
    traversability = scattered(blocks)
    paths = PosePaths(traversability, (1.025, 1.025), float(pose_kernels.HEADING_ANGLES[heading]))
    named = heading_mask(paths.headings)
    np.testing.assert_array_equal(named, np.isfinite(paths.seconds) & stands_in(traversability))


@settings(max_examples=15, deadline=None)
@given(arrays(np.int64, (3, 2), elements=st.integers(0, 39)), st.tuples(st.integers(0, 39), st.integers(0, 39)))
def test_another_obstacle_makes_no_way_cheaper(blocks, another):
    before = PosePaths(scattered(blocks), (1.0, 1.0), EAST)
    if not stands_in(before.traversability)[20, 20, 0]:
        return
    after = PosePaths(scattered(np.vstack([blocks, another])), (1.0, 1.0), EAST)
    if stands_in(after.traversability)[20, 20, 0]:
        assert (after.seconds >= before.seconds - 1e-3).all()


def test_ways_go_around_walls_in_few_drives(maze):
    paths = PosePaths(maze, (-1.0, -1.0), NORTH)
    way = paths.straightened_path_to((1.0, -1.0), -NORTH)
    assert 2 <= len(way.places) <= 8
    assert way.places[:, 1].max() > 0.85
    np.testing.assert_allclose(way.places[-1], (1, -1))
    line = np.vstack([(-1.0, -1.0), way.places])
    assert np.isfinite(maze.line_seconds(line[:-1], line[1:])).all()
    assert not way.backwards.any()
    assert way.heading == -NORTH


def test_a_path_is_simplified_to_few_lines(maze):
    path = PosePaths(maze, (-1.0, -1.0)).path_to((1.0, -1.0))
    bends = simplify(path, maze)
    assert 3 <= len(bends) <= 9
    np.testing.assert_array_equal(bends[[0, -1]], path[[0, -1]])
    assert np.isfinite(maze.line_seconds(bends[:-1], bends[1:])).all()


def test_it_backs_out_of_a_dead_end_too_narrow_to_turn_in():
    traversability = corridor(0.33)
    way = PosePaths(traversability, (1.5, 0.0), EAST).straightened_path_to((-1.0, 0.0))
    assert way.backwards.all()
    assert abs(np.cos(way.heading) - 1) < 1e-6
    assert not np.isfinite(PosePaths(traversability, (1.5, 0.0), EAST).seconds[..., nearest_heading(WEST)]).any()


def test_where_there_is_room_it_rather_turns_than_back_far():
    traversability = corridor(0.9)
    way = PosePaths(traversability, (1.2, 0.0), EAST).straightened_path_to((-1.4, 0.0))
    assert not way.backwards.any()


def test_on_a_narrow_ramp_it_does_not_turn():
    traversability = corridor(0.45, ridge)
    way = PosePaths(traversability, (-0.4, 0.0), EAST).straightened_path_to((-0.4, 0.0), WEST)
    assert (np.abs(way.places[:, 0]) > 0.8).any()  # but beside it
    assert len(PosePaths(corridor(0.45), (-0.4, 0.0), EAST).straightened_path_to((-0.4, 0.0), WEST).places) == 1


def test_a_ramp_is_met_head_on_where_that_is_no_detour():
    traversability = assess_map(surface_of(ground_points(ridge, (-2.5, 2.5), (-2, 2))))
    costs = traversability.costs()
    along, across = (
        pose_kernels.drive_seconds_per_metre(0.2, c, s, np.array([0.28, 0.0]), False, False, costs)
        for c, s in ((1, 0), (0, 1))
    )
    assert across > 1.5 * along
    path = PosePaths(traversability, (-1.8, 0.0), EAST).path_to((1.8, 0.0))
    assert np.ptp(path[:, 1]) < 0.15


def test_the_deck_is_reached_over_its_ramp_only():
    traversability = assess_map(surface_of(ground_points(ramp_and_deck, (-2, 2), (-2, 2))))
    path = PosePaths(traversability, (1.2, 1.2)).path_to((1.2, 0.0))
    assert path[:, 0].min() < -0.1


def test_a_robot_that_stands_too_near_to_a_wall_gets_away_but_not_through():
    traversability = assess_map(surface_of(ground_points(flat, (-1, 2), (-2, 2)), wall_points((1.0, -2), (1.0, 2))))
    here = np.array([0.78, 0.0])
    assert not traversability.grid.at(traversability.traversable, here)
    paths = PosePaths(traversability, here, EAST)
    way = paths.straightened_path_to((-0.3, 0.0))
    assert way.backwards[0]
    assert not np.isfinite(paths.cost[traversability.grid.cell_of((0.9, 0.0))[0] :]).any()


def test_of_several_starts_the_nearest_counts(maze):
    both = PosePaths(maze, [(-1.0, -1.0), (1.0, -1.0)])
    alone = [PosePaths(maze, start) for start in ((-1.0, -1.0), (1.0, -1.0))]
    np.testing.assert_allclose(both.cost, np.minimum(*(paths.cost for paths in alone)), rtol=1e-5)
    np.testing.assert_allclose(both.path_to((0.6, -0.6))[0], (1, -1), atol=0.05)
    source = both.sources()
    cells = [np.ravel_multi_index(tuple(maze.grid.cell_of(xy)), maze.grid.shape) for xy in ((-1, -1), (1, -1))]
    assert source[tuple(maze.grid.cell_of((0.6, -0.6)))] == cells[1]
    assert set(np.unique(source[both.reachable])) == set(cells)


def test_no_start_and_no_way():
    traversability = assess_map(surface_of(ground_points(flat, (0, 2), (0, 2))))
    for heading in (None, EAST):
        nowhere = PosePaths(traversability, (9.0, 9.0), heading)
        assert nowhere.start is None
        assert not nowhere.reachable.any()
    assert PosePaths(traversability, (1.0, 1.0)).cost_to((9.0, 9.0)) == np.inf


def test_where_the_robot_has_been_it_may_stand_nearer():
    traversability = corridor(0.28)
    assert not traversability.traversable.any()
    nowhere = np.zeros_like(traversability.hazard)
    been = assess(
        traversability.grid, traversability.elevation, nowhere, (~nowhere).astype(np.uint16), PIONEER, CONFIG
    )
    assert been.grid.at(been.traversable, (0.0, 0.0))


def test_a_robot_that_is_shut_in_goes_back_the_way_it_came():
    elevation = np.zeros((60, 60), np.float32)
    elevation[30:45, 20:26] = elevation[30:45, 35:41] = elevation[45, 20:41] = 1.0  # they leave 0.45 m between them
    elevation[30, 26:28] = elevation[30, 33:35] = 1.0  # and 0.25 m at the entrance
    nowhere, driven = np.zeros((2, 60, 60), np.uint16)
    driven[10:39, 30] = 1
    grid = Grid(np.zeros(2, np.int64), 0.05, elevation.shape)
    for track in (nowhere, driven):
        paths = PosePaths(assess(grid, elevation, nowhere > 0, track, PIONEER, CONFIG), (1.925, 1.525), EAST)
        assert np.isfinite(paths.cost_to((0.6, 1.5))) == track.any()
    assert paths.straightened_path_to((0.6, 1.525)).backwards[0]


def test_without_risk_a_way_over_a_ramp_costs_the_time_at_the_speeds_of_ramps():
    ground = assess_map(surface_of(ground_points(ridge, (-2.5, 2.5), (-2, 2))))
    paths = PosePaths(ground, (-0.8, 0.0), EAST)
    ahead, north = (-0.3, 0.0), np.pi / 2
    drive = paths.without_risk.cost_to(ahead)
    assert drive == pytest.approx(0.5 / (0.9 * PIONEER.ramp_speed), abs=0.1)
    assert drive < paths.cost_to(ahead)
    here = ground.grid.cell_of((-0.8, 0.0))[None]
    times, costs = (p.seconds_to(here)[0, nearest_heading(north)] for p in (paths.without_risk, paths))
    assert times == pytest.approx(np.pi / 2 / (0.9 * PIONEER.ramp_turn_rate), abs=0.1)
    assert times < costs


def test_without_risk_ways_cost_their_time_alone(maze):
    paths = PosePaths(maze, (-1, -1), EAST)
    times, costs = paths.without_risk.seconds, paths.seconds
    assert np.isfinite(costs).any()
    np.testing.assert_array_equal(np.isfinite(times), np.isfinite(costs))
    finite = np.isfinite(costs)
    assert (times[finite] <= costs[finite]).all()
    assert (times[finite] < 0.9 * costs[finite]).any()  # around the wall's end
    straight = (-1 + 0.25, -1)
    assert paths.without_risk.cost_to(straight) == pytest.approx(paths.cost_to(straight))
