"""Finds on the map: where they are, which are one, what is reported, and what is to be looked at again."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.frame import Frame
from pipeline.plugins.finds.config import FindsConfig
from pipeline.sensor import XTION
from pipeline.tracks.config import Confirmation
from pipeline.tracks.find import Reading, box_corners
from pipeline.tracks.finds import Finds
from pipeline.tracks.objects import observe_reading
from pipeline.transforms import from_yaw
from pipeline.victims.victim_map import Victims
from tests.pipeline.victims.rooms import HEIGHT, INTRINSICS, WALL, camera_at, step

START = np.eye(4)
KINDS = FindsConfig().kinds
SIGN, WARM = (Finds(Victims(), kinds=KINDS).policy_of(kind) for kind in ("hazmat_sign", "heat"))


def seen_from(x: float = 1.0, y: float = 0.0) -> tuple[Frame, np.ndarray]:
    """What the robot sees at a place, and its pose: the camera stands above the robot's middle."""
    frame = step(camera_at(x, y))
    return replace(frame, T_base_camera=camera_at(0, 0), time=x), from_yaw(x, y, 0, 0)


def signs_if(confirmation: Confirmation) -> Finds:
    """No finds yet; signs are reported by a rule."""
    kind = replace(KINDS["hazmat_sign"], confirmation=confirmation)
    return Finds(Victims(), kinds={"hazmat_sign": kind})


def on_wall(x: float, y: float, z: float, seen_x: float = 1.0, seen_y: float = 0.0, half: float = 6.0) -> np.ndarray:
    """The outline of a square around a point of the wall, as seen from a place."""
    depth = x - seen_x
    u, v = 80 - 144 * (y - seen_y) / depth, 60 - 144 * (z - HEIGHT) / depth
    return box_corners((u - half, v - half, u + half, v + half))


def sign(text: str, corners: np.ndarray, confidence: float = 0.9, kind: str = "hazmat_sign") -> Reading:
    return Reading(kind, text, corners, confidence)


def test_a_sign_is_placed_on_its_wall_within_its_covariance() -> None:
    frame, T = seen_from()
    finds = Finds(Victims(), kinds=KINDS)
    finds.update(frame, [sign("poison", on_wall(WALL, 0.5, 0.8))], T, 0)
    (find,) = finds.reported
    assert (find.kind, find.text, find.time_s) == ("hazmat_sign", "poison", 1.0)
    error = find.position - (WALL, 0.5, 0.8)
    assert error @ np.linalg.solve(find.covariance, error) < 1
    assert np.sqrt(np.linalg.eigvalsh(find.covariance)).max() < 0.05


def test_the_map_shows_the_returns_of_what_is_reported_and_flat() -> None:
    frame, T = seen_from()
    finds = Finds(Victims(), kinds=KINDS)
    kinds = ("hazmat_sign", 0.9), ("hazmat_sign", 0.02), ("heat", 0.9)
    at = [on_wall(WALL, y, 0.8) for y in (0.5, -0.5, 0.0)]
    finds.update(frame, [sign("", box, sure, kind) for box, (kind, sure) in zip(at, kinds, strict=True)], T, 0)
    (shown,) = finds.flat_find_points
    half = 6 * (WALL - 1) / 144
    np.testing.assert_allclose(shown.min(axis=0), (WALL, 0.5 - half, 0.8 - half), atol=0.03)
    np.testing.assert_allclose(shown.max(axis=0), (WALL, 0.5 + half, 0.8 + half), atol=0.03)


def test_sightings_of_one_thing_are_one_and_of_two_alike_are_two() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    for k, y in enumerate((0.0, 0.4)):
        frame, T = seen_from(1.0, y)
        pair = [sign("poison", on_wall(WALL, at, 0.8, seen_y=y)) for at in (0.4, 0.6)]
        finds.update(frame, pair, T, k)
    assert sorted(round(find.position[1], 1) for find in finds.reported) == [0.4, 0.6]
    assert [len(track.placed) for track in finds.all] == [2, 2]


def test_codes_of_different_texts_are_two_and_a_signs_class_is_voted() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    at = on_wall(WALL, 0.0, 0.8)
    for k, (code, kind, sure) in enumerate([("a", "poison", 0.9), ("b", "oxygen", 0.6), ("a", "poison", 0.7)]):
        frame, T = seen_from()
        finds.update(frame, [sign(code, at, 1.0, "qr_code"), sign(kind, at, sure)], T, k)
    reported = sorted((find.kind, find.text) for find in finds.reported)
    assert reported == [("hazmat_sign", "poison"), ("qr_code", "a"), ("qr_code", "b")]


def test_without_depth_a_find_is_looked_for_from_nearer_and_then_reported() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    frame, T = seen_from(-1.0)
    blind = replace(frame, depth=np.where(frame.depth > 3.5, 0, frame.depth).astype(np.float32))
    finds.update(blind, [sign("poison", on_wall(WALL, 0.5, 0.6, -1.0))], T, 0)
    assert finds.reported == []
    (wanted,) = finds.worth_a_look
    least, most = wanted.policy.viewing_range(wanted, XTION)
    assert XTION.nearest <= least < most <= XTION.farthest
    frame, T = seen_from(3.3, 0.4)
    finds.update(frame, [sign("poison", on_wall(WALL, 0.5, 0.6, 3.3, 0.4, half=30))], T, 1)
    (find,) = finds.reported
    np.testing.assert_allclose(find.position, (WALL, 0.5, 0.6), atol=0.05)
    assert finds.worth_a_look == []


def test_sightings_without_depth_do_not_move_what_has_a_place() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    frame, T = seen_from(1.0)
    warm = Reading("heat", "", on_wall(WALL, 0.0, 0.6, half=20), 1.0)
    finds.update(frame, [warm], T, 0)
    (before,) = finds.reported
    blind = replace(frame, depth=np.zeros_like(frame.depth))
    for k in range(1, 6):
        finds.update(blind, [warm], T, k)
    (track,) = finds.all
    assert len(track.placed) == 6
    np.testing.assert_array_equal(track.position, before.position)
    np.testing.assert_array_equal(track.covariance, before.covariance)


def test_what_is_too_large_for_a_sign_is_none() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    frame, T = seen_from()
    small, large = on_wall(WALL, 0.5, 0.8), on_wall(WALL, -0.5, 0.8, half=18)  # 0.25 and 0.75 m
    finds.update(frame, [sign("poison", small), sign("corrosive", large)], T, 0)
    assert [find.text for find in finds.reported] == ["poison"]


def test_a_code_that_was_only_located_is_not_reported_but_looked_at_again() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    frame, T = seen_from()
    finds.update(frame, [sign("", on_wall(WALL, 0.5, 0.8), 0.5, "qr_code")], T, 0)
    assert finds.reported == []
    assert len(finds.worth_a_look) == 1


@pytest.mark.parametrize(("kind", "from_one"), [("door_lever", 0), ("heat", 1), ("hazmat_sign", 1)])
def test_what_its_shape_identifies_is_reported_when_it_was_seen_from_two_places(kind: str, from_one: int) -> None:
    finds = Finds(Victims(), kinds=KINDS)
    for k, y in enumerate((0.0, 0.1, 0.5)):
        frame, T = seen_from(1.0, y)
        finds.update(frame, [sign("", on_wall(WALL, 0.5, 0.8, seen_y=y, half=3), 0.9, kind)], T, k)
        assert len(finds.reported) == (1 if y == 0.5 else from_one)
        assert len(finds.worth_a_look) == (kind == "hazmat_sign")


def test_what_later_keyframes_should_show_and_do_not_is_given_up() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    frame, T = seen_from()
    finds.update(frame, [sign("poison", on_wall(WALL, 0.5, 0.8), 0.6)], T, 0)
    assert len(finds.reported) == 1
    frame, T = seen_from(1.2, 0.2)
    finds.update(frame, [], T, 1)
    assert finds.reported == []
    frame, T = seen_from(-1.0)  # farther away than it was seen from: no reason for a miss
    finds.update(frame, [], T, 2)
    assert finds.all[0].missed == {1}


def test_warm_parts_of_one_body_are_one() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    for k, y in enumerate((0.0, 0.3)):
        frame, T = seen_from(2.0, y)
        parts = [on_wall(WALL, 0.5 + at, 0.8, 2.0, y, half=15) for at in (0.0, 0.35)]
        finds.update(frame, [sign("", part, 1.0, "heat") for part in parts], T, k)
    (find,) = finds.reported
    np.testing.assert_allclose(find.position, (WALL, 0.675, 0.8), atol=0.1)


def test_a_detected_thing_is_as_sure_as_its_size_makes_it() -> None:
    frame, T = seen_from()
    whole_wall = sign("", on_wall(WALL, 0.0, 0.8, half=50), 0.6, "fire_extinguisher")
    finds = Finds(Victims(), kinds=KINDS)
    finds.update(frame, [whole_wall], T, 0)
    assert finds.all[0].confidence < 0.1
    assert finds.reported == []


def test_finds_move_along_with_their_keyframes() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    frame, T = seen_from()
    finds.update(frame, [sign("poison", on_wall(WALL, 0.5, 0.8))], T, 0)
    finds.apply_poses(np.array([from_yaw(2.0, 0.0, 0.0, np.pi / 2)]))  # the keyframe was at x = 1
    np.testing.assert_allclose(finds.reported[0].position, (1.5, 3.0, 0.8), atol=0.03)


@pytest.mark.parametrize("has_depth", [True, False])
def test_without_depth_only_the_direction_is_known(has_depth: bool) -> None:
    frame, _ = seen_from()
    if not has_depth:
        frame = replace(frame, depth=np.zeros_like(frame.depth))
    sighting = observe_reading(frame, sign("poison", on_wall(WALL, 0.0, HEIGHT)), 0, START, SIGN)
    deviations = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(sighting.information)))
    assert sighting.has_depth == has_depth
    assert (deviations[-1] > 1) != has_depth
    assert deviations[0] < 0.05


def test_a_code_that_was_decoded_stays_however_often_it_is_missed() -> None:
    kept = {}
    for text in ("F5YK", ""):
        finds = Finds(Victims(), kinds=KINDS)
        frame, T = seen_from()
        finds.update(frame, [sign(text, on_wall(WALL, 0.5, 0.8), 0.5, "qr_code")], T, 0)
        for k, x in enumerate((1.1, 1.2, 1.3), start=1):
            frame, T = seen_from(x)
            finds.update(frame, [], T, k)
        kept[text] = len(finds.all)
    assert kept == {"F5YK": 1, "": 0}


def test_of_several_sightings_the_best_keeps_its_photo_alone() -> None:
    finds = Finds(Victims(), kinds=KINDS)
    for k, (x, confidence) in enumerate(((1.0, 0.6), (1.2, 0.9), (1.4, 0.7))):
        frame, T = seen_from(x)
        finds.update(frame, [sign("poison", on_wall(WALL, 0.0, 0.8, x), confidence)], T, k)
    (track,) = finds.all
    assert [seen.photo.size > 0 for seen in track.seen] == [False, True, False]
    assert track.to_find().photo.size > 0


def test_the_photo_shows_the_surroundings_and_stays_within_the_image() -> None:
    frame, _ = seen_from()
    rgb = (
        np.arange(INTRINSICS.height * INTRINSICS.width * 3, dtype=np.uint32).astype(np.uint8).reshape(frame.rgb.shape)
    )
    corner = observe_reading(replace(frame, rgb=rgb), sign("poison", box_corners((0, 0, 10, 10))), 0, START, SIGN)
    np.testing.assert_array_equal(corner.photo, rgb[:15, :15])


def test_what_is_beyond_the_range_is_not_placed_on_a_rim_before_it() -> None:
    frame, _ = seen_from()
    corners = on_wall(WALL, 0.0, HEIGHT)
    (x0, y0), (x1, y1) = corners.min(axis=0).astype(int), corners.max(axis=0).astype(int)
    depth = frame.depth.copy()
    depth[y0:y1, x0:x1] = 0
    depth[y0:y1, x0 : x0 + 3] = 0.9  # a quarter of the outline is a post
    far = observe_reading(replace(frame, depth=depth), sign("", corners, kind="heat"), 0, START, WARM)
    assert not far.has_depth
    depth[y0:y1, x0 : x1 - 3] = 0.9
    assert observe_reading(replace(frame, depth=depth), sign("", corners, kind="heat"), 0, START, WARM).has_depth


@pytest.mark.parametrize(
    ("rule", "looks"), [({}, 1), ({"confidence": 1.0}, None), ({"evidence": 1.5}, 2), ({"baseline": 0.5}, 3)]
)
def test_the_policy_of_a_kind_decides_when_it_is_reported(rule: dict[str, float], looks: int | None) -> None:
    finds, reported = signs_if(Confirmation(**rule)), []
    for k, y in enumerate((0.0, 0.4, 0.8)):
        frame, T = seen_from(1.0, y)
        finds.update(frame, [sign("poison", on_wall(WALL, 0.5, 0.8, seen_y=y))], T, k)
        reported += [k + 1] * len(finds.reported)
    assert next(iter(reported), None) == looks


def test_as_many_misses_as_the_policy_allows_take_a_report_back() -> None:
    for misses, left in ((0.5, 0), (1.5, 1)):
        finds = signs_if(Confirmation(misses=misses))
        for k, x in enumerate((1.0, 1.2)):
            frame, T = seen_from(x)
            finds.update(frame, [sign("poison", on_wall(WALL, 0.5, 0.8))][k:], T, k)
        assert len(finds.reported) == left


def test_what_returns_show_half_near_and_half_far_is_near() -> None:
    frame, _ = seen_from()
    depth = np.full_like(frame.depth, 3.0)
    depth[:55] = 2.0
    corners = box_corners((70.5, 50.5, 79.5, 59.5))  # five rows of pixels are near, and five are far
    seen = observe_reading(replace(frame, depth=depth), sign("", corners, kind="heat"), 0, START, WARM)
    np.testing.assert_allclose(seen.points[:, 0], 2.0, atol=1e-6)
