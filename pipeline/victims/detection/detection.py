"""Detections of people, and the interface of detectors."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Detection:
    """A person in an image.

    Attributes:
        box: x0, y0, x1, y1 in pixels, from the image's upper left corner.
        confidence: 0 to 1.
    """

    box: tuple[float, float, float, float]
    confidence: float


class Detector(Protocol):
    """Finds people in images."""

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        """People in an (H, W, 3) image, the most confident first."""
        ...
