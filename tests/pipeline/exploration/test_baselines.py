"""What the baselines of exploration do in small worlds."""

from itertools import pairwise

import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.exploration.baselines import NearestFrontier, RandomWalk
from pipeline.exploration.next_best_view import NextBestView
from pipeline.transforms import from_yaw
from tests.pipeline.exploration.asking import CAMERA, closed_room, context, corridor, frontiers, next_viewpoint
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points


def room(*corners, x=(-2.0, 2.0), y=(-2.0, 2.0)):
    """Ground with walls from corner to corner."""
    walls = [wall_points(a, b) for a, b in pairwise(corners)]
    return surface_of(ground_points(flat, x, y), *walls)


def test_the_nearest_frontier_in_view_is_looked_at_from_where_the_robot_stands():
    viewpoint = next_viewpoint(NearestFrontier(PIONEER), corridor(-6, 2), from_yaw(0, 0, 0, np.pi))
    assert abs(viewpoint.heading) < np.deg2rad(30)
    np.testing.assert_allclose(viewpoint.position, (0, 0), atol=1e-9)
    assert viewpoint.gain >= PIONEER.length * PIONEER.width


def test_it_drives_only_so_near_that_the_frontier_is_in_view():
    exploration = NearestFrontier(PIONEER)
    viewpoint = next_viewpoint(exploration, corridor(-9, 6), from_yaw(0, 0, 0, 0))
    assert CAMERA.near < 6 - viewpoint.position[0] <= CAMERA.far + 0.3
    assert viewpoint.turn


def test_what_is_larger_does_not_draw_it_away_from_what_is_nearer():
    world = room((-4, -2), (1.5, -2), (1.5, -0.4), x=(-4, 1.5))
    world.update(wall_points((1.5, 0.4), (1.5, 2)))  # a door in the east, all open in the west
    world.update(wall_points((1.5, 2), (-4, 2)))
    pose = from_yaw(0, 0, 0, np.pi)
    assert abs(next_viewpoint(NearestFrontier(PIONEER), world, pose).heading) < np.deg2rad(30)
    assert abs(next_viewpoint(NextBestView(PIONEER), world, pose).heading) > np.deg2rad(90)


def test_a_frontier_smaller_than_the_robot_comes_last_but_comes(monkeypatch):
    gains = np.array([[0.1, 0.2], [0.0, 0.9], [0.3, 0.8]])
    seconds = np.array([[0.0, 3.0], [2.0, 2.5], [4.0, 1.0]])
    exploration = NearestFrontier(PIONEER)
    monkeypatch.setattr(exploration, "required_gain", lambda seconds: 0.03)
    scores = exploration.scores(gains, seconds)
    np.testing.assert_equal(scores, [[0, 0], [0, 0], [0.3, 0.8]])
    scores = exploration.scores(0.25 * gains, seconds)
    np.testing.assert_equal(scores, 0.25 * np.array([[0, 0.2], [0, 0], [0, 0]]))
    assert not exploration.scores(0.01 * gains, seconds).any()


def test_a_large_frontier_that_is_not_worth_its_drive_does_not_keep_smaller_ones_from_being_visited(monkeypatch):
    gains, seconds = np.array([[0.3], [0.2]]), np.array([[120.0], [4.0]])
    exploration = NearestFrontier(PIONEER)
    monkeypatch.setattr(exploration, "required_gain", lambda seconds: 0.005 * seconds)
    np.testing.assert_equal(exploration.scores(gains, seconds), [[0], [0.2]])


def test_where_the_robot_can_not_turn_the_frontier_behind_it_is_left_for_later():
    world = room((-2, 0.33), (2, 0.33), x=(-2, 2), y=(-0.33, 0.33))
    world.update(wall_points((-2, -0.33), (2, -0.33)))
    for exploration in (NextBestView(PIONEER), NearestFrontier(PIONEER)):
        assert next_viewpoint(exploration, world, from_yaw(0, 0, 0, 0)) is not None


def test_nothing_is_left_in_a_closed_room():
    exploration = NearestFrontier(PIONEER)
    assert next_viewpoint(exploration, closed_room(), from_yaw(0, 0, 0, 0)) is None
    assert len(frontiers(closed_room(), from_yaw(0, 0, 0, 0))) == 0


def test_a_frontier_that_never_comes_into_view_is_given_up():
    world, exploration, pose = corridor(-3, 2, is_closed=True), NearestFrontier(PIONEER), from_yaw(0, 0, 0, np.pi)
    viewpoints = []
    while (viewpoint := next_viewpoint(exploration, world, pose)) is not None and len(viewpoints) < 100:
        viewpoints.append(viewpoint)
        pose = from_yaw(*viewpoint.position, 0, viewpoint.heading)
    assert 2 <= len(viewpoints) < 10
    assert len({tuple(v.position) for v in viewpoints}) > 1


def test_no_viewpoint_where_the_robot_cannot_stand():
    world = surface_of(ground_points(flat, (0, 0.3), (0, 0.3)))
    for exploration in (NearestFrontier(PIONEER), RandomWalk(PIONEER, 0)):
        assert next_viewpoint(exploration, world, from_yaw(0.1, 0.1, 0, 0)) is None


def test_a_random_walk_goes_by_its_seed_and_ends():
    world, pose = closed_room(), from_yaw(0, 0, 0, 0)

    def walk(seed):
        exploration = RandomWalk(PIONEER, seed, steps=5)
        viewpoints = [next_viewpoint(exploration, world, pose) for _ in range(5)]
        assert next_viewpoint(exploration, world, pose) is None
        return [(*viewpoint.position, viewpoint.heading) for viewpoint in viewpoints]

    assert walk(1) == walk(1)
    assert walk(1) != walk(2)


def test_a_random_walk_that_is_asked_again_in_a_step_answers_the_same_and_counts_it_once():
    world, exploration = closed_room(), RandomWalk(PIONEER, 0, steps=1)
    here = context(world, from_yaw(0, 0, 0, 0))
    places = []
    for _ in range(3):
        exploration.observe(here)
        places.append(exploration.next_viewpoint(here).position)
    np.testing.assert_array_equal(places, [places[0]] * 3)


@pytest.mark.parametrize("stride", [0.5, 1.0])
def test_a_random_walk_stays_where_the_robot_can_turn_and_not_far(stride):
    world, exploration, pose = corridor(-9, 6), RandomWalk(PIONEER, 0, stride), from_yaw(0, 0, 0, 0)
    traversability = assess_map(world)
    for _ in range(10):
        viewpoint = next_viewpoint(exploration, world, pose)
        assert np.linalg.norm(viewpoint.position - pose[:2, 3]) <= stride + 0.1
        assert traversability.grid.at(traversability.turnable, viewpoint.position)
        assert viewpoint.turn
        pose = from_yaw(*viewpoint.position, 0, viewpoint.heading)
