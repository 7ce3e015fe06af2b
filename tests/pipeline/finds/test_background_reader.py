"""Frames are read beside the drive, one at a time, and taken in their order."""

from threading import Event, get_ident

from pipeline.finds.background_reader import BackgroundReader
from pipeline.finds.find import Reading, box_corners
from pipeline.frame import Frame
from tests.pipeline.finds.victims.rooms import camera_at, step

SIGN = Reading("hazmat_sign", "poison", box_corners((0, 0, 20, 20)), 0.9)


class SlowReaders:
    """Wait until they are told to go on."""

    def __init__(self) -> None:
        self.go_on, self.thread = Event(), 0

    def glance(self, frame: Frame) -> list[Reading]:
        self.thread = get_ident()
        assert self.go_on.wait(10)
        return [SIGN]


def test_a_frame_is_read_beside_and_taken_once() -> None:
    readers, frame = SlowReaders(), step(camera_at(1, 0))
    reader = BackgroundReader(readers)  # type: ignore[arg-type]
    assert reader.end() is None
    reader.begin(frame, 7)
    readers.go_on.set()
    read = reader.end()
    assert read is not None
    assert (read.frame, read.keyframe, read.readings) == (frame, 7, [SIGN])
    assert readers.thread != get_ident()
    assert reader.end() is None
