"""Victims on the map, in a room of balls."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.keyframes import AnchoredPlaces
from pipeline.tracks.config import Confirmation, PeopleConfig
from pipeline.tracks.track import Observation
from pipeline.transforms import from_rotation, from_yaw
from pipeline.victims.detection import Detection
from pipeline.victims.observation import Refusal, observe
from pipeline.victims.victim_map import Victims
from tests.pipeline.victims.rooms import WALL, Ball, camera_at, detection_of, step

PERSON: Ball = (2.0, 0.0, 0.2, 0.25)
OTHER: Ball = (2.4, 1.5, 0.3, 0.25)


def refusal(balls: list[Ball], detection: Detection) -> str:
    result = observe(step(camera_at(0, 0), balls), detection, camera_at(0, 0))
    assert isinstance(result, Refusal)
    return result.reason


def walk(victims: Victims, places: list[tuple[float, float]], balls: list[Ball], found: list[Ball]) -> None:
    for place in places:
        look(victims, place, balls, [detection_of(camera_at(*place), ball) for ball in found])


def look(victims: Victims, place: tuple[float, float], balls: list[Ball], found: list[Detection]) -> None:
    """Look from a place, in a keyframe of its own."""
    known = {k for victim in victims.all for k in victim.keyframes | victim.missed}
    T = camera_at(*place)
    victims.update(step(T, balls), found, T, max(known, default=-1) + 1)


def test_a_person_is_where_it_is() -> None:
    T = camera_at(0, 0)
    result = observe(step(T, [PERSON]), detection_of(T, PERSON), T)
    assert isinstance(result, Observation)
    assert result.position == pytest.approx(PERSON[:3], abs=0.16)  # the front of it
    np.testing.assert_allclose(np.linalg.norm(result.points - PERSON[:3], axis=1), 0.25, atol=0.01)
    deviation = result.position - PERSON[:3]
    assert deviation @ result.information @ deviation < 11.34
    assert result.camera.tolist() == [0, 0, 0.6]


def test_the_map_may_lie_anywhere() -> None:
    T = camera_at(0, 0)
    moved = T.copy()
    moved[:3, 3] += [5, -3, 1]
    here, there = (observe(step(T, [PERSON]), detection_of(T, PERSON), pose) for pose in (T, moved))
    assert isinstance(here, Observation)
    assert isinstance(there, Observation)
    np.testing.assert_allclose(there.position - here.position, [5, -3, 1], atol=1e-5)
    np.testing.assert_allclose(np.linalg.inv(there.information), np.linalg.inv(here.information), atol=1e-6)


def test_what_is_no_person_is_refused() -> None:
    assert "flat" in refusal([], Detection((70, 30, 100, 70), 0.9))  # a picture on the wall
    assert "flat" in refusal([], Detection((40, 90, 120, 118), 0.9))  # and on the floor
    large: Ball = (3.2, 0, 0.8, 0.9)
    assert "background" in refusal([large], detection_of(camera_at(0, 0), large))


def test_what_covers_a_corner_of_its_box_is_not_what_was_detected() -> None:
    x0, y0, x1, y1 = detection_of(camera_at(0, 0), PERSON).box
    wide = Detection((x0 - 3 * (x1 - x0), y0 - 2 * (y1 - y0), x1, y1), 0.9)
    assert "background" in refusal([PERSON], wide)


def test_what_alone_has_returns_in_the_box_of_a_person_out_of_range_is_not_the_person() -> None:
    """The person is beyond the camera's range; in the corner of the box, a thing is in range."""
    T, thing = camera_at(0, 0), (2.5, 0.2, 0.5, 0.1)
    frame = step(T, [thing])
    x0, y0, x1, y1 = detection_of(T, thing).box
    frame = replace(frame, depth=np.where(frame.depth < 3, frame.depth, 0).astype(np.float32))
    assert isinstance(observe(frame, Detection((x0, y0, x1, y1), 0.9), T), Observation)
    wide = Detection((x0 - 3 * (x1 - x0), y0 - 2 * (y1 - y0), x1, y1), 0.9)
    result = observe(frame, wide, T)
    assert isinstance(result, Refusal)
    assert "background" in result.reason


def test_what_together_is_no_person_is_not_confirmed() -> None:
    row = [(2.2, y, 0.4, 0.4) for y in (-1.2, -0.6, 0.0, 0.6, 1.2)]
    victims = Victims()
    walk(victims, [(0, 0), (0, 0.4)], row, row)
    assert len(victims.all) == 1
    assert victims.confirmed == []


def test_a_hole_in_the_depth_is_refused() -> None:
    T = camera_at(0, 0)
    frame = step(T, [PERSON])
    detection = detection_of(T, PERSON)
    x0, y0, x1, y1 = map(int, detection.box)
    depth = frame.depth.copy()
    depth[y0 : y1 + 1, x0 : x1 + 1] = 0
    result = observe(replace(frame, depth=depth), detection, T)
    assert isinstance(result, Refusal)
    assert result.reason == "no depth in the box"
    outside = observe(frame, Detection((500, 500, 600, 600), 0.9), T)
    assert isinstance(outside, Refusal)


def test_two_frames_from_different_places_confirm() -> None:
    victims = Victims()
    walk(victims, [(0, 0)], [PERSON, OTHER], [PERSON])
    assert len(victims.worth_a_look) == 1
    walk(victims, [(0.1, 0)], [PERSON, OTHER], [PERSON])
    assert victims.confirmed == []
    walk(victims, [(0.1, 0.4)], [PERSON, OTHER], [PERSON])
    (victim,) = victims.confirmed
    assert victim.position == pytest.approx(PERSON[:3], abs=0.15)
    assert victim.baseline == pytest.approx(np.hypot(0.1, 0.4))
    assert victim.confidence == pytest.approx(0.9)
    assert np.sqrt(np.diag(victim.covariance)).max() < 0.2


SMALL = PeopleConfig(
    confirmation=Confirmation(evidence=0.75, full_size=0.3, evidence_of_part=1.2, misses=1.0, baseline=0.3)
)


def victims_of(confidences: tuple[float, ...], config: PeopleConfig) -> Victims:
    """After detections of one person from different places."""
    victims = Victims(config)
    for k, confidence in enumerate(confidences):
        T = camera_at(0, 0.5 * k)
        victims.update(step(T, [PERSON]), [detection_of(T, PERSON, confidence)], T, k)
    return victims


@pytest.mark.parametrize("confidences", [(0.3, 0.9), (0.9, 0.3), (0.5, 0.5), (0.4, 0.4, 0.4)])
def test_many_uncertain_detections_are_as_much_evidence_as_few_sure_ones(confidences: tuple[float, ...]) -> None:
    (victim,) = victims_of(confidences, SMALL).confirmed
    assert victim.confidence == pytest.approx(np.mean(confidences))


def test_little_evidence_is_worth_observing_again_and_less_is_not() -> None:
    for confidences, worth in (((0.3,), 0), ((0.3, 0.4), 1), ((0.6,), 1)):
        victims = victims_of(confidences, SMALL)
        assert victims.confirmed == []
        assert len(victims.worth_a_look) == worth


def test_what_is_small_takes_more_evidence() -> None:
    for confidences, is_enough in (((0.6, 0.5), False), ((0.6, 0.7), True), ((0.4, 0.4, 0.5), True)):
        victims = victims_of(confidences, PeopleConfig())
        assert len(victims.confirmed) == is_enough
        assert len(victims.worth_a_look) == (not is_enough)


def test_two_people_stay_two() -> None:
    victims = Victims()
    walk(victims, [(0, 0.7), (0, 1.2), (0.2, 0.5)], [PERSON, OTHER], [PERSON, OTHER])
    assert len(victims.all) == 2
    positions = sorted((victim.position for victim in victims.confirmed), key=lambda p: p[1])
    assert positions[0] == pytest.approx(PERSON[:3], abs=0.16)
    assert positions[1] == pytest.approx(OTHER[:3], abs=0.16)


def test_a_victim_that_is_not_found_again_is_dropped() -> None:
    victims = Victims()
    walk(victims, [(0, 0)], [PERSON], [PERSON])
    walk(victims, [(0, 0.1), (0, 0.2)], [PERSON], [])
    assert victims.all[0].missed == {1, 2}
    walk(victims, [(0, 0.3)], [PERSON], [])
    assert victims.all == []


def test_a_victim_hidden_or_out_of_sight_is_not_missed() -> None:
    victims = Victims()
    walk(victims, [(0, 0)], [PERSON], [PERSON])
    walk(victims, [(0, 0)], [PERSON, (1.2, 0, 0.4, 0.35)], [])  # something stands before it
    walk(victims, [(0, 0)], [PERSON, (1.85, 0, 0.2, 0.3)], [])  # a box around it
    walk(victims, [(0, 3), (3, 0)], [PERSON], [])  # beside it and past it
    assert not victims.all[0].missed


@pytest.mark.parametrize("empty", [0, np.nan, np.inf])
def test_a_victim_is_not_missed_by_a_frame_without_returns(empty: float) -> None:
    victims, T = Victims(), camera_at(0, 0)
    walk(victims, [(0, 0)], [PERSON], [PERSON])
    frame = step(T, [PERSON])
    victims.update(replace(frame, depth=np.full_like(frame.depth, empty)), [], T, 1)
    assert not victims.all[0].missed


def test_refusals_have_reasons() -> None:
    victims = Victims()
    T = camera_at(0, 0)
    victims.update(step(T), [Detection((70, 30, 100, 70), 0.9)], T, 0)
    assert victims.all == []
    assert "flat" in victims.refusals[0].reason


def test_the_best_photo_is_kept() -> None:
    victims = Victims()
    for k, (y, confidence, colour) in enumerate(((0.0, 0.6, 10), (0.4, 0.8, 20), (0.2, 0.7, 30))):
        T = camera_at(0, y)
        frame = step(T, [PERSON])
        frame.rgb[:] = colour
        victims.update(frame, [detection_of(T, PERSON, confidence)], T, k)
    (victim,) = victims.all
    assert (victim.photo == 20).all()
    assert victim.photo.size
    assert victim.confidence == pytest.approx(0.7)


def test_a_photo_of_the_whole_person_is_better_than_one_of_a_part() -> None:
    victims, T = Victims(), camera_at(0, 0)
    x0, y0, x1, y1 = detection_of(T, PERSON).box
    half = (y0 + y1) / 2
    for k, (brightness, bottom, confidence) in enumerate(((10, half, 1.0), (20, y1, 0.8), (30, half, 1.0))):
        frame = step(T, [PERSON])
        frame.rgb[:] = brightness
        victims.update(frame, [Detection((x0, y0, x1, bottom), confidence)], T, k)
    (victim,) = victims.all
    assert (victim.photo == 20).all()


LEGS: Ball = (2.0, -0.8, 0.2, 0.25)


def test_a_person_seen_in_parts_is_one_person() -> None:
    victims = Victims()
    walk(victims, [(0, 0)], [PERSON, LEGS], [PERSON])
    walk(victims, [(0, 0.1)], [PERSON, LEGS], [LEGS])
    assert len(victims.all) == 2
    x, y, z, r = PERSON
    both = detection_of(camera_at(0.1, 0.4), (x, y - 0.4, z, r + 0.4))
    look(victims, (0.1, 0.4), [PERSON, LEGS], [both])
    (victim,) = victims.all
    assert len(victim.camera_positions) == 3
    assert victim.position == pytest.approx((x, y - 0.4, z), abs=0.16)


def test_what_one_of_many_keyframes_takes_for_a_part_of_a_person_is_none_even_if_the_others_do_not_see_it() -> None:
    victims, beside, before = Victims(), (2.0, -0.6, 0.2, 0.25), (1.0, -0.2, 0.4, 0.16)
    T = camera_at(0, 0)
    victims.update(step(T, [PERSON, beside]), [detection_of(T, PERSON), detection_of(T, beside)], T, 0)
    T = camera_at(0, 0.2)
    for k in range(1, 6):
        victims.update(step(T, [PERSON, beside, before]), [detection_of(T, PERSON)], T, k)
    (victim,) = victims.all
    assert len(victim.keyframes) == 6
    assert victim.points[:, 1].min() > -0.4


def test_two_whom_different_frames_show_are_one_if_they_touch() -> None:
    for y, people in ((-0.6, 1), (-1.4, 2)):  # 0.1 and 0.9 m apart
        victims, beside = Victims(), (2.0, y, 0.2, 0.25)
        walk(victims, [(0, 0)], [PERSON], [PERSON])
        walk(victims, [(0, y + 0.4)], [beside], [beside])
        assert sum(len(victim.seen) for victim in victims.all) == 2
        assert len(victims.all) == people


def test_two_whom_one_frame_shows_apart_are_two_though_they_touch_later() -> None:
    victims, near = Victims(), (2.0, -0.4, 0.2, 0.25)
    walk(victims, [(0, 0)], [PERSON, LEGS], [PERSON, LEGS])
    assert len(victims.all) == 2
    walk(victims, [(0, 0.4)], [PERSON, near], [near])
    assert len(victims.all) == 2


def test_two_whom_a_wall_separates_are_two_though_they_lean_against_it_back_to_back() -> None:
    for x, people in ((2.0, 1), (WALL, 2)):
        victims, ball = Victims(), (x, 0.0, 0.25, 0.25)
        for k, T in enumerate((camera_at(x - 2, 0), from_yaw(x + 2, 0, 0, np.pi) @ camera_at(0, 0))):
            victims.update(step(T, [ball]), [detection_of(T, ball)], T, k)
        assert len(victims.all) == people


def test_two_boxes_of_one_person_in_one_frame_are_one_person() -> None:
    victims = Victims()
    x0, y0, x1, y1 = detection_of(camera_at(0, 0), PERSON).box
    boxes = [(x0, y0, x1, y1), (x0, y0, x1, y0 + 0.6 * (y1 - y0)), (x0, y0 + 0.4 * (y1 - y0), x1, y1)]
    look(victims, (0, 0), [PERSON], [Detection(box, 0.9) for box in boxes])
    (victim,) = victims.all
    assert len(victim.camera_positions) == 3


def test_the_wall_behind_a_person_that_fills_the_image_is_not_the_person() -> None:
    T = camera_at(2.7, 0)
    near: Ball = (3.7, 0.0, 0.6, 0.28)
    result = observe(step(T, [near]), Detection((4, 2, 156, 118), 0.9), T)
    assert isinstance(result, Observation)
    np.testing.assert_allclose(np.linalg.norm(result.points - near[:3], axis=1), 0.28, atol=0.02)


def test_of_what_stands_one_behind_the_other_the_nearest_is_the_person() -> None:
    T = camera_at(0, 0)
    behind: Ball = (3.0, 0.0, 0.3, 0.3)
    result = observe(step(T, [PERSON, behind]), detection_of(T, (2.0, 0.0, 0.3, 0.4)), T)
    assert isinstance(result, Observation)
    assert result.points[:, 0].max() < 2.1


def test_victims_follow_the_keyframes_that_showed_them() -> None:
    victims, moved, places = Victims(), Victims(), [(0.0, 0.0), (0.2, 0.5), (0.4, -0.5)]
    poses = np.tile(np.eye(4), (3, 1, 1))
    shift = np.tile(from_rotation(np.eye(3), (2, -1, 0.1)), (3, 1, 1))
    for each in (victims, moved):
        for keyframe, place in enumerate(places):
            T = camera_at(*place)
            each.update(step(T, [PERSON]), [detection_of(T, PERSON)], T, keyframe)
        each.all[0].tried.append(AnchoredPlaces.anchored([(1.0, 0.0, 0.0)], poses))
    moved.apply_poses(shift @ poses)
    (old,), (new,) = victims.all, moved.all
    np.testing.assert_allclose(new.position - old.position, (2, -1, 0.1), atol=5e-3)
    np.testing.assert_allclose(new.covariance, old.covariance, atol=1e-4)
    np.testing.assert_allclose(
        np.array(new.camera_positions) - old.camera_positions, np.tile((2, -1, 0.1), (3, 1)), atol=1e-9
    )
    np.testing.assert_allclose(new.tried_at, [(3, -1, 0.1)], atol=1e-9)
    assert (new.confidence, new.missed) == (old.confidence, old.missed)


def test_a_person_that_drift_has_doubled_is_one_after_the_correction() -> None:
    victims, drift = Victims(), from_rotation(np.eye(3), (0, 2.5, 0))
    T = camera_at(0, 0)
    for keyframe, pose in enumerate((T, drift @ T)):
        victims.update(step(T, [PERSON]), [detection_of(T, PERSON)], pose, keyframe)
    assert len(victims.all) == 2
    victims.apply_poses(np.tile(np.eye(4), (2, 1, 1)))
    assert len(victims.all) == 1
    assert victims.all[0].position == pytest.approx(PERSON[:3], abs=0.16)


def test_a_person_merged_from_two_tracks_stays_the_same_when_no_keyframe_moves() -> None:
    victims, drift, poses = Victims(), from_rotation(np.eye(3), (0, 2.5, 0)), np.tile(np.eye(4), (4, 1, 1))
    for keyframe, (x, y) in enumerate([(0, 0), (0.4, 0.3), (0.2, -0.3), (0.6, 0)]):
        T = camera_at(x, y)
        pose = T if keyframe < 2 else drift @ T
        victims.update(step(T, [PERSON]), [detection_of(T, PERSON)], pose, keyframe)
    assert [len(victim.seen) for victim in victims.all] == [2, 2]
    victims.apply_poses(poses)
    (merged,) = victims.all
    before = merged.covariance
    victims.apply_poses(poses)
    np.testing.assert_allclose(merged.covariance, before, rtol=1e-12)


def test_a_body_beside_the_box_of_its_hand_is_no_wall() -> None:
    T, hand, body = camera_at(0, 0), (2.0, 0.0, 0.5, 0.1), (2.6, 0.5, 0.6, 0.5)
    result = observe(step(T, [hand, body]), detection_of(T, hand), T)
    assert isinstance(result, Observation)
    np.testing.assert_allclose(result.walls, [[-1, 0, 0, -WALL]], atol=0.01)
