"""Re-observation in a room of balls."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.keyframes import Keyframes
from pipeline.metric_map.metric_map import MetricMap
from pipeline.sensor import XTION
from pipeline.tracks.config import ReobservationConfig
from pipeline.tracks.reobservation import Reobservation, max_view_angles
from pipeline.transforms import from_yaw
from pipeline.victims.victim_map import Victims
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.victims.rooms import INTRINSICS, Ball, camera_at, detection_of, step

PERSON: Ball = (2.0, 0.0, 0.2, 0.25)
CONFIG = ReobservationConfig()
BEARINGS = np.arange(36) * np.deg2rad(10)


@pytest.fixture
def reobservation() -> Reobservation:
    """After one detection from the origin, in a map that three frames have made."""
    return seen_once(mapped_room())[1]


def mapped_room() -> MetricMap:
    metric_map = MetricMap()
    for y in (-1.0, 0.0, 1.0):
        frame = step(camera_at(-0.5, y), [PERSON])
        metric_map.integrate(frame.depth, INTRINSICS, camera_at(-0.5, y))
    return metric_map


def seen_once(
    metric_map: MetricMap, keyframes: Keyframes | None = None, config: ReobservationConfig = CONFIG
) -> tuple[Victims, Reobservation]:
    victims, T = Victims(), camera_at(0, 0)
    frame = step(T, [PERSON])
    victims.update(frame, [detection_of(T, PERSON)], T, 0)
    result = Reobservation([victims], metric_map, one_keyframe() if keyframes is None else keyframes, config)
    result.count_try(frame)
    return victims, result


def one_keyframe() -> Keyframes:
    keyframes = Keyframes(PIONEER, reach=3.5, cell=0.05, min_displacement=0.01)
    keyframes.poses = np.eye(4)[None]
    return keyframes


def take_keyframe(keyframes: Keyframes, x: float, y: float) -> None:
    keyframes.poses = np.concatenate([keyframes.poses, from_yaw(x, y, 0, 0)[None]])


def place(x: float, y: float) -> np.ndarray:
    return np.array([[x, y, 0.0]])


def bearing_to_person(x: float, y: float) -> np.ndarray:
    return np.array([np.arctan2(-y, PERSON[0] - x)])


def test_an_unconfirmed_victim_is_worth_a_viewpoint_on_another_side(reobservation):
    gains = reobservation.gains(np.vstack([place(0.6, 1.1), place(0.0, 0.2), place(0.0, 0.5)]), BEARINGS)
    from_the_side, from_where_it_was_seen, from_near_there = gains.max(axis=1)
    assert from_the_side == pytest.approx(1)
    assert from_where_it_was_seen == 0
    assert 0 < from_near_there < 0.6


def test_only_viewpoints_towards_it_count(reobservation):
    x, y = 0.6, 1.1
    towards = bearing_to_person(x, y)
    off = np.array([0.0, 0.6, -0.6, 1.6, -1.6, 3.0, 9.0]) * max_view_angles(
        step(camera_at(0, 0)), reobservation.wanted[0], np.array([1.5])
    )
    counts = reobservation.gains(place(x, y), towards + off)[0] > 0
    assert counts.tolist() == [True, True, True, False, False, False, False]


def test_a_near_object_must_be_nearer_to_the_middle_of_the_image(reobservation):
    for x, counts in ((-0.4, True), (0.6, False)):
        place_there = place(x, 1.1)
        assert (reobservation.gains(place_there, bearing_to_person(x, 1.1)) > 0).all()
        assert (reobservation.gains(place_there, bearing_to_person(x, 1.1) + 0.29) > 0).all() == counts


@pytest.mark.parametrize(("limits", "counts"), [({}, True), ({"nearest": 1.4}, False), ({"farthest": 1.7}, False)])
def test_neither_too_near_nor_too_far(reobservation, limits, counts):
    x, y = 0.6, 1.1  # 1.5 m away from what is seen
    reobservation.count_try(replace(step(camera_at(0, 0)), sensor=replace(XTION, **limits)))
    assert (reobservation.gains(place(x, y), bearing_to_person(x, y)) > 0) == counts


def test_not_through_unknown_space_nor_through_obstacles():
    x, y = 0.6, 1.1
    metric_map = mapped_room()
    _, reobservation = seen_once(metric_map)
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) > 0
    _, unmapped = seen_once(MetricMap())
    assert unmapped.gains(place(x, y), bearing_to_person(x, y)) == 0
    add_ball(metric_map, (1.1, 0.75, 0.45, 0.2))
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) == 0


def add_ball(metric_map: MetricMap, ball: Ball) -> None:
    T = camera_at(-0.5, 1.0)
    for _ in range(20):
        metric_map.integrate(step(T, [PERSON, ball]).depth, INTRINSICS, T)


def test_a_victims_own_feet_do_not_hide_it():
    metric_map = mapped_room()
    victims, reobservation = seen_once(metric_map)
    (victim,) = victims.all
    x, y = 0.6, 1.1
    towards = np.array([x, y, 0.6]) - PERSON[:3]
    feet = np.array(PERSON[:3]) + 0.4 * towards  # further before its middle than the margin
    add_ball(metric_map, (*map(float, feet), 0.15))
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) == 0  # they may belong to another object
    victim.location = replace(victim.location, points=np.vstack([victim.points, feet[None]]).astype(np.float32))
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) > 0


def test_after_a_try_in_vain_another_side_is_taken(reobservation):
    (victim,) = reobservation.wanted
    beside = np.vstack([place(x, y) for x, y in ((0.6, 1.1), (0.3, -0.3), (0.6, -1.1))])
    before = reobservation.gains(beside, BEARINGS).max(axis=1)
    assert (before > 0).all()
    victim.tried_at = [place(0.6, 1.5)[0]]
    same_side, found_side, other_side = reobservation.gains(beside, BEARINGS).max(axis=1)
    assert same_side == 0
    assert (found_side, other_side) == pytest.approx(before[1:])


def test_after_some_tries_in_vain_it_is_given_up():
    keyframes = one_keyframe()
    _, reobservation = seen_once(mapped_room(), keyframes, ReobservationConfig(max_tries=2))
    frame = step(camera_at(0, 0), [PERSON])
    for tries, (x, y) in enumerate([(0.6, 1.0), (0.6, -1.0)]):
        heading = float(bearing_to_person(x, y)[0])
        (victim,) = reobservation.wanted
        assert len(victim.tried) == tries
        reobservation.aim(place(x, y)[0], heading + np.pi)
        reobservation.count_try(frame)  # that one was for something else
        reobservation.aim(place(x, y)[0], heading)
        take_keyframe(keyframes, x, y)
        reobservation.count_try(frame)
        assert reobservation.gains(place(x, y), bearing_to_person(x, y)) == 0  # not from there again
    assert reobservation.wanted == []
    assert not reobservation.gains(place(0.6, 0.5), BEARINGS).any()


def test_a_try_that_ended_elsewhere_counts_but_leaves_the_place_to_look_from():
    keyframes, there = one_keyframe(), place(0.6, 1.1)
    victims, reobservation = seen_once(mapped_room(), keyframes)
    towards = bearing_to_person(0.6, 1.1)
    before = reobservation.gains(there, towards)
    reobservation.aim(there[0], float(towards[0]))
    take_keyframe(keyframes, 0.1, 0.0)
    reobservation.count_try(step(camera_at(0, 0)))
    assert len(victims.all[0].tried) == 1
    assert reobservation.gains(there, towards) == before > 0
    victims.apply_poses(keyframes.poses)
    assert (len(victims.all[0].tried), victims.all[0].tried_at) == (1, [])


def test_the_confirmed_are_left_alone():
    victims, reobservation = seen_once(mapped_room())
    T = camera_at(0.1, 0.5)
    victims.update(step(T, [PERSON]), [detection_of(T, PERSON)], T, 1)
    assert victims.confirmed
    assert reobservation.wanted == []


def test_what_the_next_frame_is_aimed_at_follows_a_correction() -> None:
    keyframes = one_keyframe()
    victims, reobservation = seen_once(mapped_room(), keyframes)
    there = place(0.6, 1.1)[0]
    reobservation.aim(there, float(bearing_to_person(0.6, 1.1)[0]))
    keyframes.poses = from_yaw(2, 0, 0, np.pi / 2)[None]
    take_keyframe(keyframes, 0.9, 0.6)
    reobservation.count_try(step(camera_at(0, 0)))
    np.testing.assert_allclose(victims.all[0].tried_at, [(0.9, 0.6, 0)], atol=1e-12)
