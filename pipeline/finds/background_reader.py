"""Looks at frames in a thread of its own, while they are put into the maps and the robot drives on."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import torch

from pipeline.finds.readers import FindReader
from pipeline.frame import Frame
from pipeline.tracks.find import Reading
from pipeline.victims.detection.detection import Detection, Detector


@dataclass(frozen=True, eq=False)
class ReadFrame:
    """A frame and what it shows.

    Attributes:
        frame: of a keyframe.
        keyframe: its number.
        detections: in its image.
        readings: in its image.
    """

    frame: Frame
    keyframe: int
    detections: list[Detection]
    readings: list[Reading]


class BackgroundReader:
    """Reads one frame at a time; its caller decides when it takes the result, so that episodes repeat exactly."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, initializer=_alone)
        self._begun: Future[ReadFrame] | None = None

    def begin(self, frame: Frame, keyframe: int, detector: Detector | None, readers: FindReader | None) -> None:
        """Begin to read the frame of a keyframe; one that was begun before must have been taken by :meth:`end`.

        Without a detector no people are found, without readers nothing else.
        """
        assert self._begun is None
        self._begun = self._thread.submit(_read, frame, keyframe, detector, readers)

    def end(self) -> ReadFrame | None:
        """Wait until the frame that was begun is read, and give what it shows; None if none was begun."""
        begun, self._begun = self._begun, None
        return None if begun is None else begun.result()


def _read(frame: Frame, keyframe: int, detector: Detector | None, readers: FindReader | None) -> ReadFrame:
    detections = [] if detector is None else detector.detect(frame.rgb)
    readings = [] if readers is None else readers.read(frame, detections)
    return ReadFrame(frame, keyframe, detections, readings)


def _alone() -> None:
    """Let this thread compute alone: further threads of OpenCV and PyTorch wait for work in a busy loop.

    On two cores beside a thread that computes as well, that makes an image take up to seven times as long.
    """
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
