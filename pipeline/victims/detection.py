"""Detections of the objects that a rescue robot looks for, and the interface of detectors."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.tracks.find import KINDS, VICTIM


@dataclass(frozen=True)
class Detection:
    """An object in an image.

    Attributes:
        box: x0, y0, x1, y1 in pixels, from the image's upper left corner.
        confidence: confidence from 0 to 1.
        kind: one of :data:`pipeline.tracks.find.KINDS`.
    """

    box: tuple[float, float, float, float]
    confidence: float
    kind: str = VICTIM


class Detector(Protocol):
    """Finds objects in images."""

    def detect(self, rgb: Rgb) -> list[Detection]:
        """Objects in an image, of the detector's kinds, the most confident first."""
        ...


def check_detections(detections: object, detector: object) -> None:
    """Check that a detector has returned detections of known kinds, with finite boxes and confidences from 0 to 1.

    Raises:
        InputError: the detector has returned something else.
    """
    where = f"{type(detector).__name__}.detect"
    if not isinstance(detections, list) or not all(isinstance(found, Detection) for found in detections):
        raise InputError(f"{where}: must return a list of Detection objects, not {detections!r:.60}")
    for found in detections:
        if np.shape(found.box) != (4,) or not np.isfinite(found.box).all():
            raise InputError(f"{where}: the box must be four finite numbers, x0, y0, x1 and y1, not {found}")
        if not 0 <= found.confidence <= 1:
            raise InputError(f"{where}: the confidence must be from 0 to 1, not {found.confidence:g}")
        if found.kind not in KINDS:
            raise InputError(f"{where}: the kind must be one of {', '.join(KINDS)}, not {found.kind!r}")
