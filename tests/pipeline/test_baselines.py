"""What the baselines of exploration do in small worlds."""

from itertools import pairwise

import numpy as np

from pipeline.baselines import NearestFrontier, NearestFrontierConfig, RandomWalk
from pipeline.exploration import Exploration
from pipeline.surface.drivable import drivable_surface
from pipeline.surface.paths import ShortestPaths
from pipeline.transforms import from_yaw
from tests.pipeline.worlds import RUN, flat, ground_points, ridge, surface_of, wall_points


def next_view(exploration: Exploration, world, pose):
    surface = drivable_surface(world)
    return exploration.next_view(surface, world.measured, ShortestPaths(surface, pose[:2, 3]), pose)


def room(*corners, x=(-2.0, 2.0), y=(-2.0, 2.0)):
    """Ground with walls from corner to corner."""
    walls = [wall_points(a, b) for a, b in pairwise(corners)]
    return surface_of(ground_points(flat, x, y), *walls)


def closed_room():
    return room((-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -2))


def corridor(west, east):
    """Open at both ends, along x."""
    world = surface_of(ground_points(flat, (west, east), (-1, 1)))
    for y in (-1, 1):
        world.update(wall_points((west, y), (east, y)))
    return world


def test_the_nearest_frontier_is_where_the_way_is_shortest():
    view = next_view(NearestFrontier(), corridor(-6, 2), from_yaw(0, 0, 0, 0))
    assert abs(view.heading) < np.deg2rad(30)
    np.testing.assert_allclose(view.position, (0, 0), atol=1e-9)  # it sees as far as that from where it is


def test_it_drives_only_so_near_that_the_frontier_is_in_view():
    view = next_view(NearestFrontier(), corridor(-9, 6), from_yaw(0, 0, 0, 0))
    config = NearestFrontierConfig()
    assert config.near <= np.linalg.norm(view.position - (6, view.position[1])) <= config.far + 0.1
    assert view.turn


def test_what_is_larger_does_not_draw_it_away_from_what_is_nearer():
    world = room((-4, -2), (1.5, -2), (1.5, -0.4), x=(-4, 1.5))
    world.update(wall_points((1.5, 0.4), (1.5, 2)))  # a door in the east, all open in the west
    world.update(wall_points((1.5, 2), (-4, 2)))
    view = next_view(NearestFrontier(), world, from_yaw(0, 0, 0, np.pi))
    assert abs(view.heading) < np.deg2rad(30)


def test_nothing_is_left_in_a_closed_room():
    exploration = NearestFrontier()
    assert next_view(exploration, closed_room(), from_yaw(0, 0, 0, 0)) is None
    assert len(exploration.frontiers) == 0


def test_each_frontier_counts_once_and_the_nearest_first():
    exploration = NearestFrontier()
    next_view(exploration, corridor(-3, 2), from_yaw(0, 0, 0, 0))
    assert exploration.frontiers.shape == (2, 3)
    np.testing.assert_allclose(exploration.frontiers[:, 0], (2, -3), atol=0.1)


def test_a_frontier_that_never_comes_into_view_is_given_up():
    world, exploration, pose = corridor(-3, 2), NearestFrontier(), from_yaw(0, 0, 0, 0)
    world.update(wall_points((-3, -1), (-3, 1)))
    views = []
    while (view := next_view(exploration, world, pose)) is not None and len(views) < 100:
        views.append(view)
        pose = from_yaw(*view.position, 0, view.heading)
    assert 3 <= len(views) < 100
    assert len({tuple(v.position) for v in views}) > 1


def test_a_wall_hides_what_lies_behind_it():
    world = room((-2, 0.5), (2, 0.5), x=(-2, 2), y=(-2, 2))
    view = next_view(NearestFrontier(), world, from_yaw(0, -0.3, 0, 0))
    ahead = view.position + 1.1 * np.array([np.cos(view.heading), np.sin(view.heading)])
    assert ahead[1] < 0.5


def test_on_a_ramp_it_looks_the_way_it_stands():
    world = surface_of(ground_points(ridge, (-2.5, 1.0), (-0.6, 0.6)))
    for y in (-0.6, 0.6):
        world.update(wall_points((-2.5, y), (1.0, y)))
    pose = from_yaw(-RUN / 2, 0, 0, np.deg2rad(5))
    view = next_view(NearestFrontier(), world, pose)
    np.testing.assert_allclose(view.position, pose[:2, 3])
    assert not view.turn
    np.testing.assert_allclose(view.heading, np.deg2rad(5))


def test_nobody_looks_from_where_the_robot_cannot_stand():
    world = surface_of(ground_points(flat, (0, 0.3), (0, 0.3)))
    for exploration in (NearestFrontier(), RandomWalk(0)):
        assert next_view(exploration, world, from_yaw(0.1, 0.1, 0, 0)) is None


def test_a_random_walk_goes_by_its_seed():
    world, pose = closed_room(), from_yaw(0, 0, 0, 0)

    def walk(seed):
        exploration = RandomWalk(seed)
        views = [next_view(exploration, world, pose) for _ in range(5)]
        return [(*view.position, view.heading) for view in views]

    assert walk(1) == walk(1)
    assert walk(1) != walk(2)


def test_a_random_walk_stays_where_the_robot_can_turn_and_not_far():
    world, exploration, pose = corridor(-9, 6), RandomWalk(0, stride=1.0), from_yaw(0, 0, 0, 0)
    surface = drivable_surface(world)
    for _ in range(20):
        view = next_view(exploration, world, pose)
        assert np.linalg.norm(view.position - pose[:2, 3]) <= 1.0 + 0.1
        assert surface.grid.at(surface.turnable, view.position)
        assert view.turn
        pose = from_yaw(*view.position, 0, view.heading)
