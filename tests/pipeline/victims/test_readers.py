"""Frames are read beside the drive, one at a time, and taken in their order."""

from dataclasses import replace
from threading import Event, get_ident

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.tracks.find import Reading, box_corners
from pipeline.victims.detection import Detection
from pipeline.victims.readers import BackgroundReader
from tests.pipeline.victims.rooms import camera_at, step

PERSON = Detection((0, 0, 20, 20), 0.8)
SIGN = Reading("hazmat_sign", "poison", box_corners((0, 0, 20, 20)), 0.9)


class SlowReaders:
    """Wait until they may go on."""

    def __init__(self, sign: Reading = SIGN) -> None:
        self.go_on, self.thread, self.sign = Event(), 0, sign

    def read(self, frame: Frame, detections: list[Detection]) -> list[Reading]:
        self.thread = get_ident()
        assert detections == [PERSON]
        assert self.go_on.wait(10)
        return [self.sign]


class DetectorOfOne:
    """Finds a person in every image."""

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        assert rgb.dtype == np.uint8
        return [PERSON]


def test_a_frame_is_read_beside_and_taken_once() -> None:
    readers, frame = SlowReaders(), step(camera_at(1, 0))
    reader = BackgroundReader()
    assert reader.end() is None
    reader.begin(frame, 7, DetectorOfOne(), readers)
    readers.go_on.set()
    read = reader.end()
    assert read is not None
    assert (read.frame, read.keyframe, read.detections, read.readings) == (frame, 7, [PERSON], [SIGN])
    assert readers.thread != get_ident()
    assert reader.end() is None


def test_a_kind_that_no_map_could_hold_is_refused_when_it_is_read() -> None:
    readers, reader = SlowReaders(replace(SIGN, kind="Red Square")), BackgroundReader()
    readers.go_on.set()
    reader.begin(step(camera_at(1, 0)), 7, DetectorOfOne(), readers)
    with pytest.raises(InputError, match="'Red Square'"):
        reader.end()


def test_without_a_detector_and_readers_nothing_is_found() -> None:
    reader = BackgroundReader()
    reader.begin(step(camera_at(1, 0)), 3, None, None)
    read = reader.end()
    assert read is not None
    assert (read.keyframe, read.detections, read.readings) == (3, [], [])
