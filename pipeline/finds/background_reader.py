"""Read frames in a separate thread, while they are added to the maps and the robot drives on."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import torch

from pipeline.finds.readers import FindReader
from pipeline.frame import Frame
from pipeline.tracks.find import Reading
from pipeline.victims.detection.detection import Detection, Detector, check_detections


@dataclass(frozen=True, eq=False)
class ReadFrame:
    """A frame and what it shows.

    Attributes:
        frame: the frame of a keyframe.
        keyframe: index of the keyframe.
        detections: detections in the frame's image.
        readings: readings in the frame.
    """

    frame: Frame
    keyframe: int
    detections: list[Detection]
    readings: list[Reading]


class BackgroundReader:
    """Reads one frame at a time; the caller decides when to take the result, so that episodes repeat exactly."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, initializer=_alone)
        self._begun: Future[ReadFrame] | None = None

    def begin(self, frame: Frame, keyframe: int, detector: Detector | None, readers: FindReader | None) -> None:
        """Begin to read the frame of a keyframe; the previous one must have been taken with :meth:`end`.

        Without a detector, no people are found; without readers, nothing else is.
        """
        assert self._begun is None
        self._begun = self._thread.submit(_read, frame, keyframe, detector, readers)

    def end(self) -> ReadFrame | None:
        """Wait until the frame that was begun has been read, and return what it shows; None if none was begun."""
        begun, self._begun = self._begun, None
        return None if begun is None else begun.result()


def _read(frame: Frame, keyframe: int, detector: Detector | None, readers: FindReader | None) -> ReadFrame:
    detections = [] if detector is None else detector.detect(frame.rgb)
    check_detections(detections, detector)
    readings = [] if readers is None else readers.read(frame, detections)
    return ReadFrame(frame, keyframe, detections, readings)


def _alone() -> None:
    """Make OpenCV and PyTorch compute in this thread alone: their other threads wait for work in a busy loop.

    On two cores, while another thread computes as well, that makes an image take up to seven times as long.
    """
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
