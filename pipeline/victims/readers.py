"""Find objects in frames in a separate thread, while the frames are added to the maps and the robot drives."""

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.tracks.config import ObjectConfig
from pipeline.tracks.find import HEAT, Reading, is_find_kind, is_same
from pipeline.victims.config import HeatConfig
from pipeline.victims.detection import Detection, Detector, check_detections

MIN_OUTLINE = 4
"""Minimum number of pixels on the outline of a warm region; a smaller region may be a lamp or a hot pixel."""


class FindReader(Protocol):
    """Finds objects of some kinds in a frame; users may write their own.

    A reader may have an attribute ``kinds``, a mapping from kinds to :class:`pipeline.tracks.config.ObjectConfig`,
    which defines how objects of each kind are tracked.
    """

    def read(self, frame: Frame, detections: Sequence[Detection]) -> list[Reading]:
        """The objects that a frame shows, given a detector's boxes in its image.

        The method may be called in another thread.
        """
        ...


class CombinedReaders:
    """Combines several readers; if several readers find the same object, the reading of the first reader is kept."""

    def __init__(self, readers: Sequence[FindReader]):
        """``readers``: in the order in which they read."""
        self._readers = readers

    @property
    def kinds(self) -> dict[str, ObjectConfig]:
        """How each kind is tracked; the settings of earlier readers take precedence."""
        every = [getattr(reader, "kinds", {}) for reader in self._readers]
        return {kind: numbers for kinds in reversed(every) for kind, numbers in kinds.items()}

    def read(self, frame: Frame, detections: Sequence[Detection]) -> list[Reading]:
        """The objects that a frame shows, given a detector's boxes in its image."""
        found: list[Reading] = []
        for reader in self._readers:
            found += not_among(reader.read(frame, detections), found)
        return found


def not_among(readings: Sequence[Reading], read: Sequence[Reading]) -> list[Reading]:
    """The readings of objects that have no reading in ``read``."""
    return [r for r in readings if not any(r.kind == k.kind and is_same(r.corners, k.corners) for k in read)]


@dataclass(frozen=True, eq=False)
class ReadFrame:
    """A frame and the objects found in it.

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
    """Reads one frame at a time; the caller decides when to take the result, so that episodes are reproducible."""

    def __init__(self, heat: HeatConfig = HeatConfig()) -> None:
        """``heat``: which regions of a thermal image are warm."""
        self._thread, self._heat = ThreadPoolExecutor(1, initializer=_limit_to_one_thread), heat
        self._begun: Future[ReadFrame] | None = None

    def begin(self, frame: Frame, keyframe: int, detector: Detector | None, readers: FindReader | None) -> None:
        """Begin to read the frame of a keyframe; the previous frame must have been taken with :meth:`end`.

        Without a detector, no people and no heat are found; without readers, no other objects are found.
        """
        if self._begun is not None:
            raise RuntimeError("the previous frame has not been taken with end()")
        self._begun = self._thread.submit(_read, frame, keyframe, detector, readers, self._heat)

    def end(self) -> ReadFrame | None:
        """Wait until the frame of :meth:`begin` has been read, and return it with its objects; None without a frame.

        Raises:
            InputError: the detector or a reader has returned something invalid.
        """
        begun, self._begun = self._begun, None
        return None if begun is None else begun.result()


def _read(
    frame: Frame, keyframe: int, detector: Detector | None, readers: FindReader | None, heat: HeatConfig
) -> ReadFrame:
    """The objects in a frame; InputError if the detector or a reader returns something invalid."""
    detections = [] if detector is None else detector.detect(frame.rgb)
    check_detections(detections, detector)
    readings = [] if readers is None else readers.read(frame, detections)
    if wrong := [reading.kind for reading in readings if not is_find_kind(reading.kind)]:
        raise InputError(f"the kind {wrong[0]!r} of a reader: must be up to 40 of a-z, 0-9 and _, beginning with a-z")
    if detector is not None and frame.thermal is not None:
        readings = [*readings, *warm_regions(frame.thermal, frame.rgb.shape, heat)]
    return ReadFrame(frame, keyframe, detections, readings)


def warm_regions(thermal: NDArray[np.float32], shape: tuple[int, ...], config: HeatConfig) -> Iterator[Reading]:
    """The warm regions of a thermal image (h, w), °C, as readings in the colour image of the given ``shape``.

    Both images have the same field of view, but their pixels may differ in shape.
    """
    warm = np.isfinite(thermal) & (thermal > np.nanmedian(thermal) + config.min_temperature_excess)
    scale = np.divide(shape[1::-1], thermal.shape[::-1])
    contours, _ = cv2.findContours(warm.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        if len(contour) >= MIN_OUTLINE:
            middles = cv2.convexHull(contour)[:, 0] + np.float32(0.5)
            yield Reading(HEAT, "", (middles * scale).astype(np.float32), 1.0)


def _limit_to_one_thread() -> None:
    """Keep OpenCV and PyTorch from starting threads of their own, which would wait for work in a busy loop.

    On two cores, while another thread computes as well, such loops make an image take up to seven times as long.
    PyTorch's setting applies only to the calling thread. OpenCV's setting applies to the whole process, so every call
    of OpenCV then computes in the calling thread.
    """
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
