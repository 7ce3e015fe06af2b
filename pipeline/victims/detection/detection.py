"""Detections of what a rescue robot looks for, and the interface of detectors."""

from dataclasses import dataclass
from typing import Protocol

from pipeline.arrays import Rgb
from pipeline.tracks.find import VICTIM


@dataclass(frozen=True)
class Detection:
    """An object in an image.

    Attributes:
        box: x0, y0, x1, y1 in pixels, from the image's upper left corner.
        confidence: 0 to 1.
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
