"""Loops that a second keyframe confirms, and that later constraints remove."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.loops import Candidate, LoopCloser, seen_through_fraction
from pipeline.localisation.pose_graph import ConstraintKind, PoseGraph
from pipeline.localisation.registration import Target
from pipeline.transforms import from_yaw, inverse, transform_points
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
            graph.connect(k - 1, k, T, (10.0 if k == 5 else 1e4) * np.eye(6), ConstraintKind.MOTION)
    graph.optimise()
    return graph


def propose(loops: LoopCloser, graph: PoseGraph, keyframe: int, first: int, T: NDArray[np.float64]) -> None:
    """Propose that a keyframe is at a pose, according to an older keyframe."""
    loops.propose(Candidate(keyframe, first, inverse(graph.poses[first]) @ T, np.linalg.inv(SURE)))


BACK = {6: (2, 0.5), 7: (1, 0.25), 8: (0, 0.0)}
"""Which old keyframe each new one repeats, and where along x it was."""


def test_few_keyframes_close_no_loop() -> None:
    graph = there_and_back(0.3)
    loops = LoopCloser(graph, CONFIG)
    for keyframe in (7, 8):
        owner, x = BACK[keyframe]
        propose(loops, graph, keyframe, owner, from_yaw(x, 0, 0, 0))
    before = graph.poses.copy()
    loops.close()
    assert not loops.is_due and not loops.closed
    np.testing.assert_array_equal(graph.poses, before)


def test_keyframes_that_find_the_same_place_close_a_loop() -> None:
    graph = there_and_back(0.3)
    loops = LoopCloser(graph, CONFIG)
    for keyframe, (owner, x) in BACK.items():
        propose(loops, graph, keyframe, owner, from_yaw(x, 0, 0, 0))
    assert loops.is_due
    loops.close()
    graph.optimise()
    assert [(loop.first, loop.second) for loop in loops.closed] == [(2, 6), (1, 7), (0, 8)]
    np.testing.assert_allclose(graph.poses[5:, 0, 3], [0.75, 0.5, 0.25, 0], atol=0.01)
    assert not loops.remove_contradicted()


@settings(deadline=None)
@given(st.floats(0.3, 0.5), st.floats(-np.pi, np.pi))
def test_keyframes_that_contradict_each_other_close_none(off: float, direction: float) -> None:
    graph = there_and_back(0.3)
    loops = LoopCloser(graph, CONFIG)
    for n, (keyframe, (owner, x)) in enumerate(BACK.items()):
        moved = n * off * np.array([np.cos(direction), np.sin(direction)])
        propose(loops, graph, keyframe, owner, from_yaw(x + moved[0], moved[1], 0, 0))
    assert not loops.is_due


@pytest.mark.parametrize("turned", [0.0, np.pi / 2])
def test_a_candidate_may_be_off_where_its_registration_is_weak_whichever_way_the_robot_turns_afterwards(
    turned: float,
) -> None:
    """The first candidate is 0.2 m off along the direction in which its keyframe was registered to only 5 cm."""
    graph = PoseGraph(CONFIG)
    for T in (np.eye(4), from_yaw(5, 0, 0, 0), from_yaw(5, 0.6, 0, turned)):
        graph.add(T, UP)
    loops = LoopCloser(graph, replace(CONFIG, loops=replace(CONFIG.loops, min_agreeing=2)))
    registered = np.diag(np.square([0.01, 0.01, 0.01, 0.05, 0.02, 0.02]))
    loops.propose(Candidate(1, 0, from_yaw(5.2, 0, 0, 0), registered))
    sure = np.diag(np.square([0.01, 0.01, 0.01, 0.02, 0.02, 0.02]))
    loops.propose(Candidate(2, 0, graph.poses[2], sure))
    assert loops.is_due


def test_keyframes_at_one_place_count_as_one() -> None:
    """However often the robot looks from there, the same alias may mislead it."""
    graph = PoseGraph(CONFIG)
    for k in range(9):
        graph.add(from_yaw(0, 0, 0, 0.02 * k), UP)
        if k:
            graph.connect(k - 1, k, graph.poses[k], 1e4 * np.eye(6), ConstraintKind.MOTION)
    graph.optimise()
    loops = LoopCloser(graph, CONFIG)
    for k in range(5, 9):
        propose(loops, graph, k, 0, graph.poses[k] @ from_yaw(0.4, 0, 0, 0))
    assert not loops.is_due


def test_a_loop_that_bends_what_was_straight_is_taken_back() -> None:
    """Keyframes all agree on an alias, but the graph is sure of its chain."""
    graph = there_and_back(0.0)
    for i, j in ((3, 5), (2, 6), (1, 7), (0, 8)):
        graph.connect(i, j, graph.poses[i], SURE, ConstraintKind.SURFACE)
        graph.connect(i, j - 1, graph.poses[j - 1], SURE, ConstraintKind.SURFACE)
    graph.optimise()
    before, loops = graph.poses.copy(), LoopCloser(graph, CONFIG)
    for keyframe, (owner, x) in BACK.items():
        propose(loops, graph, keyframe, owner, from_yaw(x + 0.6, 0, 0, 0))
    loops.close()
    assert loops.closed
    graph.optimise()
    assert loops.remove_contradicted()
    graph.optimise()
    assert not loops.closed and not loops.remove_contradicted()
    np.testing.assert_allclose(graph.poses, before, atol=0.01)


@pytest.fixture(scope="module")
def place() -> Target:
    """A wall 2 m ahead of where the robot was, as points."""
    points = [(2.0, y, z) for y in np.arange(-1, 1, 0.05) for z in np.arange(0.1, 0.9, 0.05)]
    return Target(np.array(points), np.tile([-1.0, 0, 0], (len(points), 1)), np.zeros(len(points), np.int64))


def test_a_frame_looks_through_walls_where_it_is_believed_too_far_back(place: Target) -> None:
    T = np.eye(4)
    frame = seen(T, T, 0, [floor(-5, 5, -5, 5), wall((2.0, -2), (2.0, 2))])
    points = place.points
    assert seen_through_fraction(frame, T, points, 0.1) == 0
    # The wall is expected farther away.
    assert seen_through_fraction(frame, from_yaw(-0.5, 0, 0, 0), points, 0.1) == 0
    # It is expected 1.5 m ahead, and is seen 0.5 m behind that.
    assert seen_through_fraction(frame, from_yaw(0.5, 0, 0, 0), points, 0.1) > 0.9
    assert seen_through_fraction(frame, from_yaw(0.5, 0, 0, 0), points, 0.7) == 0


def test_an_infinite_depth_shows_nothing(place: Target) -> None:
    frame = seen(np.eye(4), np.eye(4))
    endless = replace(frame, depth=np.full_like(frame.depth, np.inf))
    assert seen_through_fraction(endless, np.eye(4), place.points, 0.1) == 0


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_moving_the_map_with_the_robot_changes_nothing(place: Target, x: float, y: float, yaw: float) -> None:
    frame = seen(np.eye(4), np.eye(4), 0, [floor(-5, 5, -5, 5), wall((2.0, -2), (2.0, 2))])
    T, points, before = from_yaw(x, y, 0, yaw), place.points, from_yaw(0.5, 0, 0, 0)
    moved = seen_through_fraction(frame, T @ before, transform_points(T, points), 0.1)
    assert moved == pytest.approx(seen_through_fraction(frame, before, points, 0.1), abs=0.02)


def test_behind_the_robot_nothing_is_seen_through(place: Target) -> None:
    frame = seen(np.eye(4), np.eye(4), 0, [floor(-5, 5, -5, 5)])
    assert seen_through_fraction(frame, from_yaw(0, 0, 0, np.pi), place.points, 0.1) == 0
