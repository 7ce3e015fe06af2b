"""Finds of a reader of one's own, beside those of the shipped ones."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from pipeline.frame import Frame
from pipeline.tracks.config import Confirmation, ObjectConfig
from pipeline.tracks.find import Reading, box_corners, is_find_kind
from pipeline.tracks.finds import Finds
from pipeline.transforms import from_yaw
from pipeline.victims.detection import Detection
from pipeline.victims.readers import CombinedReaders
from pipeline.victims.victim_map import Victims
from tests.pipeline.victims.rooms import WALL, camera_at, step


class ReaderOf:
    """Finds the same in every image."""

    def __init__(self, *found: Reading):
        self.found = list(found)

    def read(self, frame: Frame, detections: Sequence[Detection]) -> list[Reading]:
        return self.found


def test_of_one_object_the_first_readers_word_counts() -> None:
    box, beside = box_corners((0, 0, 20, 20)), box_corners((40, 0, 60, 20))
    sign = Reading("hazmat_sign", "poison", box, 0.9)
    same, other, red = (
        Reading(kind, "", at, 0.5)
        for kind, at in (("hazmat_sign", box + 1), ("hazmat_sign", beside), ("red_square", box))
    )
    readers = CombinedReaders([ReaderOf(sign), ReaderOf(same, other, red)])
    assert readers.read(step(camera_at(1, 0)), []) == [sign, other, red]


def shown_ahead(finds: Finds, **confidences: float) -> None:
    """Let two keyframes, 0.2 m apart, show objects of some kinds in the middle of the image."""
    for k in range(2):
        x = 1.0 + 0.2 * k
        frame = replace(step(camera_at(x, 0.0)), T_base_camera=camera_at(0, 0), time=x)
        u, v, half = frame.intrinsics.cx, frame.intrinsics.cy, 10 / (WALL - x)
        box = box_corners((u - half, v - half, u + half, v + half))
        readings = [Reading(kind, "", box, sure) for kind, sure in confidences.items()]
        finds.update(frame, readings, from_yaw(x, 0, 0, 0), k)


def test_a_kind_of_ones_own_is_followed_and_reported_if_it_is_likelier_than_not() -> None:
    finds = Finds(Victims())
    shown_ahead(finds, red_square=0.8, reobservation=0.4)
    (find,) = finds.reported
    assert (find.kind, find.text, find.confidence) == ("red_square", "", pytest.approx(0.8))
    assert find.position[0] == pytest.approx(WALL, abs=0.05) and find.position[1] == pytest.approx(0, abs=0.05)
    assert [len(track.placed) for track in finds.all] == [2, 2]


def test_a_reader_says_how_its_kinds_are_followed() -> None:
    strict = ObjectConfig(confirmation=Confirmation(confidence=0.9))
    finds = Finds(Victims(), kinds={"red_square": strict})
    shown_ahead(finds, red_square=0.8, blue_square=0.8)
    assert [track.policy.kind for track in finds.all] == ["red_square", "blue_square"]
    assert [find.kind for find in finds.reported] == ["blue_square"]


def test_kinds_are_words_and_people_are_no_finds() -> None:
    assert all(map(is_find_kind, ["red_square", "heat", "x2"]))
    assert not any(map(is_find_kind, ["", "victim", "Red", "red square", "<b>", "red\n", "x" * 41]))
