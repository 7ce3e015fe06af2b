"""Squares in an image: found once for all readers, and rectified."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.finds.quads import find_quads
from pipeline.tracks.pictures import bounded

PATCH, SURROUNDINGS = 64, 0.1
"""Pixels along a patch, and the share of it that surrounds what it shows on each side."""


@dataclass(frozen=True, eq=False)
class Squares:
    """An image and what may be squares in it.

    Attributes:
        image: (H, W, 3) uint8.
        scale: its pixels over those of the original along a side.
        quads: (N, 4, 2) float32 corners in ``image``, pixels, clockwise.
    """

    image: NDArray[np.uint8]
    scale: float
    quads: NDArray[np.float32]

    @classmethod
    def of(cls, rgb: NDArray[np.uint8]) -> "Squares":
        """Those of an (H, W, 3) or grey (H, W) uint8 image; InputError if it is empty or of another type."""
        image, scale = bounded(rgb)
        return cls(image, scale, find_quads(image))


def corners_in(side: int) -> NDArray[np.float32]:
    """(4, 2) corners of the square that a patch of ``side`` pixels shows."""
    low, high = SURROUNDINGS * side, (1 - SURROUNDINGS) * side
    return np.array([[low, low], [high, low], [high, high], [low, high]], np.float32)


def rectified(
    image: NDArray[np.uint8], quad: NDArray[np.float32], side: int = PATCH, interpolation: int = cv2.INTER_LINEAR
) -> NDArray[np.uint8]:
    """(side, side, ...) uint8 a quadrilateral of (4, 2) corners, pixels, as a square with a margin."""
    T = cv2.getPerspectiveTransform(quad, corners_in(side))
    shrunk = side / max(*cv2.boundingRect(quad)[2:], side)
    if shrunk < 1 / 2:  # by areas, for a perspective transform takes single pixels
        size = max(1, round(shrunk * image.shape[1] * 2)), max(1, round(shrunk * image.shape[0] * 2))
        part = np.diag([image.shape[1] / size[0], image.shape[0] / size[1], 1])
        image, T = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8), T @ part
    patch = cv2.warpPerspective(image, T, (side, side), flags=interpolation, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(patch, np.uint8)


def is_same(one: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """Whether more than half of the smaller of two quadrilaterals, (4, 2) pixels, lies in the other."""
    return overlap(one, other)[1] > 1 / 2


def overlap(one: NDArray[np.float32], other: NDArray[np.float32]) -> tuple[float, float]:
    """The area that two quadrilaterals, (4, 2) pixels, share, over that of both together and over the smaller."""
    common, _ = cv2.intersectConvexConvex(cv2.convexHull(one), cv2.convexHull(other))
    areas = cv2.contourArea(one), cv2.contourArea(other)
    return common / max(sum(areas) - common, 1), common / max(min(areas), 1)
