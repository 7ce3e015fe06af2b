"""Second looks in a room of balls."""

import numpy as np
import pytest

from pipeline.metric_map.metric_map import MetricMap
from pipeline.victims.reobservation import Reobservation, ReobservationConfig
from pipeline.victims.victim_map import Victims
from tests.pipeline.victims.rooms import INTRINSICS, Ball, camera_at, detection_of, step

PERSON: Ball = (2.0, 0.0, 0.2, 0.25)
CONFIG = ReobservationConfig()
BEARINGS = np.arange(36) * np.deg2rad(10)


@pytest.fixture
def reobservation() -> Reobservation:
    """After one look from the origin, in a map that three looks have made."""
    metric_map, victims, T = MetricMap(), Victims(), camera_at(0, 0)
    for y in (-1.0, 0.0, 1.0):
        frame = step(camera_at(-0.5, y), [PERSON])
        metric_map.integrate(frame.depth, INTRINSICS, camera_at(-0.5, y))
    victims.update(step(T, [PERSON]), [detection_of(T, PERSON)], T)
    return Reobservation(victims, metric_map)


def place(x: float, y: float) -> np.ndarray:
    return np.array([[x, y, 0.0]])


def bearing_to_person(x: float, y: float) -> np.ndarray:
    return np.array([np.arctan2(-y, PERSON[0] - x)])


def test_someone_unconfirmed_is_worth_a_look_from_another_side(reobservation):
    gains = reobservation.gains(np.vstack([place(0.6, 1.1), place(0.0, 0.2), place(0.0, 0.5)]), BEARINGS)
    from_the_side, from_where_it_was_seen, from_near_there = gains.max(axis=1)
    assert from_the_side == pytest.approx(CONFIG.worth)
    assert from_where_it_was_seen == 0
    assert CONFIG.least * CONFIG.worth <= from_near_there < 0.6 * CONFIG.worth


def test_only_looks_towards_it_count(reobservation):
    x, y = 0.6, 1.1
    towards = bearing_to_person(x, y)
    off = np.array([0.0, 0.7, -0.7, 1.3, -1.3, 3.0, 9.0]) * CONFIG.half_view
    counts = reobservation.gains(place(x, y), towards + off)[0] > 0
    assert counts.tolist() == [True, True, True, False, False, False, False]


@pytest.mark.parametrize(("settings", "counts"), [({}, True), ({"near": 1.8}, False), ({"far": 1.3}, False)])
def test_neither_too_near_nor_too_far(reobservation, settings, counts):
    x, y = 0.6, 1.1  # 1.5 m away from what is seen
    reobservation.config = ReobservationConfig(**settings)
    assert (reobservation.gains(place(x, y), bearing_to_person(x, y)) > 0) == counts


def test_not_through_what_nobody_has_seen_nor_through_obstacles(reobservation):
    x, y = 0.6, 1.1
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) > 0
    unseen = Reobservation(reobservation._victims, MetricMap())
    assert unseen.gains(place(x, y), bearing_to_person(x, y)) == 0
    T = camera_at(-0.5, 1.0)
    for _ in range(20):
        frame = step(T, [PERSON, (1.1, 0.75, 0.45, 0.2)])
        reobservation._map.integrate(frame.depth, INTRINSICS, T)
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) == 0


def test_the_feet_before_someone_hide_nobody(reobservation):
    (victim,) = reobservation._victims.all
    x, y = 0.6, 1.1
    towards = np.array([x, y, 0.6]) - PERSON[:3]
    feet = np.array(PERSON[:3]) + 0.4 * towards  # further before its middle than the margin
    for _ in range(20):
        T = camera_at(-0.5, 1.0)
        frame = step(T, [PERSON, (*map(float, feet), 0.15)])
        reobservation._map.integrate(frame.depth, INTRINSICS, T)
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) == 0  # of something else
    victim.points = np.vstack([victim.points, feet]).astype(np.float32)
    assert reobservation.gains(place(x, y), bearing_to_person(x, y)) > 0


def test_after_a_look_in_vain_another_side_is_taken(reobservation):
    (victim,) = reobservation.wanted
    beside = np.vstack([place(x, y) for x, y in ((0.6, 1.1), (0.3, -0.3), (0.6, -1.1))])
    before = reobservation.gains(beside, BEARINGS).max(axis=1)
    assert (before > 0).all()
    victim.tried = [place(0.6, 1.5)[0]]
    same_side, found_side, other_side = reobservation.gains(beside, BEARINGS).max(axis=1)
    assert same_side == 0
    assert (found_side, other_side) == pytest.approx(before[1:])


def test_after_some_looks_in_vain_it_is_given_up(reobservation):
    reobservation.config = ReobservationConfig(tries=2)
    for tries, (x, y) in enumerate([(0.6, 1.0), (0.6, -1.0)]):
        heading = float(bearing_to_person(x, y)[0])
        (victim,) = reobservation.wanted
        assert len(victim.tried) == tries
        reobservation.aim(place(x, y)[0], heading + np.pi)
        reobservation.count()  # that one was for something else
        reobservation.aim(place(x, y)[0], heading)
        reobservation.count()
        assert reobservation.gains(place(x, y), bearing_to_person(x, y)) == 0  # not from there again
    assert reobservation.wanted == []
    assert not reobservation.gains(place(0.6, 0.5), BEARINGS).any()


def test_the_confirmed_are_left_alone(reobservation):
    T = camera_at(0.1, 0.5)
    reobservation._victims.update(step(T, [PERSON]), [detection_of(T, PERSON)], T)
    assert reobservation._victims.confirmed
    assert reobservation.wanted == []
