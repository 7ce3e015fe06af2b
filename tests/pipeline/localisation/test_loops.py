"""Loops that a second keyframe confirms, and that later constraints take back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.loops import Loops, looks_the_same, seen_through
from pipeline.localisation.pose_graph import PoseGraph
from pipeline.localisation.registration import Registration, Share, Target
from pipeline.transforms import from_yaw, transform_points
from tests.pipeline.localisation.driving_robot import seen
from tests.pipeline.polygon_scene import floor, wall

CONFIG = LocalisationConfig()
SURE = 1e4 * np.eye(6)
UP = np.array([0.0, 0.0, 1.0])


def there_and_back(drift: float) -> PoseGraph:
    """1 m out and back by keyframes each 0.25 m, of which the graph has the later ones ``drift`` m too far on."""
    graph = PoseGraph(CONFIG)
    for k, x in enumerate([0, 0.25, 0.5, 0.75, 1, 0.75, 0.5, 0.25, 0]):
        T = from_yaw(x + (drift if k > 4 else 0.0), 0, 0, 0)
        graph.add(T, UP)
        if k:
            weak = 1.0 if k == 5 else 1e4
            graph.connect(k - 1, k, T, weak * np.eye(6))
            graph.link(k - 1, k, np.eye(6) / weak)
    return graph


def registered(T: NDArray[np.float64]) -> Registration:
    return Registration(T, SURE, np.linalg.inv(SURE), 1.0, 0.0, SURE, True, True)


def propose(loops: Loops, keyframe: int, owner: int, T: NDArray[np.float64]) -> None:
    loops.propose(keyframe, registered(T), [Share(owner, T, SURE)])


def test_one_keyframe_alone_closes_no_loop() -> None:
    graph = there_and_back(0.3)
    loops = Loops(graph, CONFIG)
    propose(loops, 7, 1, from_yaw(0.25, 0, 0, 0))
    before = graph.poses.copy()
    loops.close()
    assert not loops.is_due and not loops.closed
    np.testing.assert_array_equal(graph.poses, before)


def test_a_second_keyframe_that_finds_the_place_where_the_first_has_it_closes_both() -> None:
    graph = there_and_back(0.3)
    loops = Loops(graph, CONFIG)
    propose(loops, 7, 1, from_yaw(0.25, 0, 0, 0))
    propose(loops, 8, 0, np.eye(4))
    assert loops.is_due
    loops.close()
    graph.optimise()
    assert [(loop.first, loop.second) for loop in loops.closed] == [(1, 7), (0, 8)]
    np.testing.assert_allclose(graph.poses[5:, 0, 3], [0.75, 0.5, 0.25, 0], atol=0.01)
    assert not loops.take_back()


@given(st.floats(0.2, 0.5), st.floats(-np.pi, np.pi))
def test_two_keyframes_that_contradict_each_other_close_none(off: float, direction: float) -> None:
    loops = Loops(there_and_back(0.3), CONFIG)
    propose(loops, 7, 1, from_yaw(0.25, 0, 0, 0))
    propose(loops, 8, 0, from_yaw(off * np.cos(direction), off * np.sin(direction), 0, 0))
    assert not loops.is_due


def test_the_newer_of_two_that_contradict_each_other_may_still_be_confirmed() -> None:
    loops = Loops(there_and_back(0.3), CONFIG)
    propose(loops, 6, 1, from_yaw(0.9, 0, 0, 0))
    propose(loops, 7, 1, from_yaw(0.25, 0, 0, 0))
    propose(loops, 8, 0, np.eye(4))
    loops.close()
    assert {loop.second for loop in loops.closed} == {7, 8}


def test_a_keyframe_that_is_not_known_relative_to_the_newest_one_confirms_nothing() -> None:
    loops = Loops(there_and_back(0.3), CONFIG)
    propose(loops, 4, 0, from_yaw(1.0, 0, 0, 0))
    propose(loops, 8, 0, from_yaw(-0.3, 0, 0, 0))
    assert not loops.is_due


def test_a_loop_that_later_constraints_contradict_is_taken_back() -> None:
    graph = there_and_back(0.0)
    loops = Loops(graph, CONFIG)
    for keyframe, x in ((7, 0.25), (8, 0.0)):
        propose(loops, keyframe, 1, from_yaw(x + 0.6, 0, 0, 0))
    loops.close()
    assert loops.closed
    before = there_and_back(0.0).poses
    graph.connect(3, 5, graph.poses[3], SURE)
    graph.connect(2, 6, graph.poses[2], SURE)
    graph.optimise()
    assert loops.take_back()
    graph.optimise()
    assert not loops.closed and not loops.take_back()
    np.testing.assert_allclose(graph.poses, before, atol=0.01)
    assert graph.deviations(8)[1] > 0.1


@pytest.fixture(scope="module")
def place() -> Target:
    """A wall 2 m ahead of where the robot was, as points."""
    points = [(2.0, y, z) for y in np.arange(-1, 1, 0.05) for z in np.arange(0.1, 0.9, 0.05)]
    return Target(np.array(points), np.tile([-1.0, 0, 0], (len(points), 1)), np.zeros(len(points), np.int64))


def test_a_frame_looks_through_walls_where_it_is_believed_too_far_back(place: Target) -> None:
    T = np.eye(4)
    frame = seen(T, T, 0, [floor(-5, 5, -5, 5), wall((2.0, -2), (2.0, 2))])
    points = place.points
    assert seen_through(frame, T, points, 0.1) == 0
    assert seen_through(frame, from_yaw(-0.5, 0, 0, 0), points, 0.1) == 0  # the wall is expected farther away
    assert seen_through(frame, from_yaw(0.5, 0, 0, 0), points, 0.1) > 0.9  # it is expected 1.5 m ahead
    assert seen_through(frame, from_yaw(0.5, 0, 0, 0), points, 0.7) == 0  # and is seen 0.5 m behind that
    assert looks_the_same(frame, T, from_yaw(0.5, 0, 0, 0), place.points, 0.1)
    assert not looks_the_same(frame, from_yaw(0.5, 0, 0, 0), T, place.points, 0.1)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_moving_the_map_with_the_robot_changes_nothing(place: Target, x: float, y: float, yaw: float) -> None:
    frame = seen(np.eye(4), np.eye(4), 0, [floor(-5, 5, -5, 5), wall((2.0, -2), (2.0, 2))])
    T, points, before = from_yaw(x, y, 0, yaw), place.points, from_yaw(0.5, 0, 0, 0)
    moved = seen_through(frame, T @ before, transform_points(T, points), 0.1)
    assert moved == pytest.approx(seen_through(frame, before, points, 0.1), abs=0.02)


def test_behind_the_robot_nothing_is_seen_through(place: Target) -> None:
    frame = seen(np.eye(4), np.eye(4), 0, [floor(-5, 5, -5, 5)])
    assert seen_through(frame, from_yaw(0, 0, 0, np.pi), place.points, 0.1) == 0
