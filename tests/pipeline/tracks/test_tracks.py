"""Tracks of marks on a line, with cases small enough to be worked out by hand."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.arrays import Pose
from pipeline.frame import Frame
from pipeline.sensor import SensorModel
from pipeline.tracks.config import Confirmation
from pipeline.tracks.find import Reading
from pipeline.tracks.track import Location, Observation, Track, TrackPolicy
from pipeline.tracks.tracks import Tracks, join_nearest
from pipeline.transforms import from_yaw
from tests.pipeline.victims.rooms import camera_at, step

CAMERA = camera_at(0, 0)
FRAME = step(CAMERA)


@dataclass(frozen=True, kw_only=True)
class MarkPolicy(TrackPolicy):
    """Marks on the x axis: those less than half a metre apart are one, and every keyframe should show all."""

    kind: str = "mark"
    confirmation: Confirmation = Confirmation(confidence=0.5)
    across: float = 0.1
    photo_margin: float = 0.0

    def locate(self, placed: Sequence[Observation]) -> Location:
        position = np.mean([seen.position for seen in placed], axis=0)
        return Location(position, np.eye(3), position[None].astype(np.float32))

    def photo_score(self, observation: Observation) -> float:
        return observation.reading.confidence

    def distance(self, track: Track, new: Track) -> float:
        apart = abs(float(track.position[0] - new.position[0]))
        return apart if apart < 0.5 else np.inf

    def merge_distance(self, one: Track, other: Track) -> float:
        return self.distance(one, other)

    def is_expected_in_view(self, track: Track, frame: Frame, T_camera_map: Pose) -> bool:
        return True

    def is_worth_a_look(self, track: Track) -> bool:
        return not track.is_confirmed

    def viewing_range(self, track: Track, sensor: SensorModel) -> tuple[float, float]:
        return sensor.nearest, sensor.farthest


def mark(x: float, keyframe: int, confidence: float = 0.9, missed: frozenset[int] = frozenset()) -> Track:
    """A mark that one keyframe, at the origin, shows at x; ``missed`` keyframes did not show it."""
    reading = Reading("mark", "", np.zeros((4, 2), np.float32), confidence)
    photo = np.zeros((1, 1, 3), np.uint8)
    points = np.array([[x, 0, 0]], np.float32)
    seen = Observation(reading, keyframe, np.array([x, 0.0, 0.0]), np.eye(3), np.zeros(3), points, photo)
    return Track(MarkPolicy(), [seen], [seen], missed=set(missed))


def tracks_of(*keyframes: Sequence[float]) -> Tracks:
    """What a row of keyframes at the origin leaves, each of which shows marks at some x."""
    tracks = Tracks(join_nearest)
    for k, marks in enumerate(keyframes):
        tracks.add([mark(x, k) for x in marks], FRAME, CAMERA, k)
    return tracks


def test_a_sighting_does_not_erase_the_misses_before_it() -> None:
    (track,) = tracks_of([1.0], [], [1.1]).all
    assert track.missed == {1}
    assert track.keyframes == {0, 2}
    assert track.confidence == pytest.approx((0.9 + 0.9) / 3)


def test_a_keyframe_misses_only_what_it_should_have_shown_before_it_was_taken() -> None:
    early, late = tracks_of([0.0], [], [1.0]).all
    assert (early.missed, late.missed) == ({1, 2}, set())


@pytest.mark.parametrize(("later", "left"), [([[], []], 1), ([[], [], []], 0)])
def test_a_track_is_given_up_when_it_was_missed_more_than_twice_as_often_as_seen(later, left) -> None:
    tracks = tracks_of([1.0], [], [], [1.0], *later)
    assert len(tracks.all) == left


def test_two_detections_in_a_keyframe_count_as_one() -> None:
    tracks = Tracks(join_nearest)
    tracks.add([mark(1.0, 0, 0.6), mark(1.1, 0, 0.9), mark(1.2, 0, 0.3)], FRAME, CAMERA, 0)
    tracks.add([], FRAME, CAMERA, 1)
    (track,) = tracks.all
    assert (len(track.seen), track.evidence) == (3, 0.9)
    assert track.confidence == pytest.approx(0.9 / 2)
    assert not track.is_confirmed
    for keyframe in (2, 3):
        tracks.add([], FRAME, CAMERA, keyframe)
    assert tracks.all == []


@pytest.mark.parametrize(("misses", "is_reported"), [(0, True), (1, False)])
def test_misses_count_as_detections_with_confidence_0(misses: int, is_reported: bool) -> None:
    (track,) = tracks_of([1.0], *[[]] * misses).all
    assert track.confidence == pytest.approx(0.9 / (1 + misses))
    assert track.is_confirmed == is_reported


def test_of_two_that_turn_out_to_be_one_each_keyframe_counts_once() -> None:
    tracks = tracks_of([0.0], [1.0], [])  # keyframe 1 misses the first, 2 misses both
    assert [track.missed for track in tracks.all] == [{1, 2}, {2}]
    tracks.apply_poses(np.stack([np.eye(4), from_yaw(-0.9, 0, 0, 0), np.eye(4)]))
    (track,) = tracks.all
    assert track.position[0] == pytest.approx((0.0 + 0.1) / 2)
    assert track.keyframes == {0, 1}
    assert track.missed == {2}  # keyframe 1 shows the second, which is the same


SOME_KEYFRAMES = st.frozensets(st.integers(2, 9))


@given(SOME_KEYFRAMES, SOME_KEYFRAMES)
def test_misses_do_not_depend_on_which_track_takes_the_other(one: frozenset[int], other: frozenset[int]) -> None:
    a, b = mark(0.0, 0, missed=one), mark(0.1, 1, missed=other)
    c, d = mark(0.0, 0, missed=one), mark(0.1, 1, missed=other)
    a.absorb(b)
    d.absorb(c)
    assert a.missed == d.missed == one | other
