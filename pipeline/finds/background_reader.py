"""Reads frames in a thread of its own, while the robot drives on."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

from pipeline.finds.find import Reading
from pipeline.finds.readers import FindReaders
from pipeline.frame import Frame


@dataclass(frozen=True, eq=False)
class ReadFrame:
    """A frame and what it shows.

    Attributes:
        frame: of a keyframe.
        keyframe: its number.
        readings: in its image.
    """

    frame: Frame
    keyframe: int
    readings: list[Reading]


class BackgroundReader:
    """Reads one frame at a time; its caller decides when it takes the result, so that episodes repeat exactly."""

    def __init__(self, readers: FindReaders):
        """With the readers of signs and codes."""
        self._readers, self._thread = readers, ThreadPoolExecutor(1)
        self._begun: tuple[Frame, int, Future[list[Reading]]] | None = None

    def begin(self, frame: Frame, keyframe: int) -> None:
        """Begin to read the frame of a keyframe; one that was begun before must have been taken by :meth:`end`."""
        assert self._begun is None
        self._begun = frame, keyframe, self._thread.submit(self._readers.glance, frame)

    def end(self) -> ReadFrame | None:
        """Wait until the frame that was begun is read, and give what it shows; None if none was begun."""
        if self._begun is None:
            return None
        (frame, keyframe, future), self._begun = self._begun, None
        return ReadFrame(frame, keyframe, future.result())
