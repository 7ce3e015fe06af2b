"""Find the squares in an image, once for all readers, and rectify them."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pixels, Rgb
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.plugins.finds.config import SquaresConfig
from pipeline.plugins.finds.quads import find_quads

PATCH_SIDE, MARGIN_FRACTION = 64, 0.1
"""Side of a patch, pixels, and the fraction of it that is margin on each side, as in the networks' training."""


@dataclass(frozen=True, eq=False)
class SquareCandidates:
    """An image and the possible squares in it.

    Attributes:
        image: the image, in three channels.
        scale: side length of the image relative to the original.
        quads: (N, 4, 2) float32 corners in ``image``, pixels, clockwise.
    """

    image: Rgb
    scale: float
    quads: NDArray[np.float32]

    @cached_property
    def pyramid(self) -> "Pyramid":
        """The image pyramid from which squares are rectified."""
        return Pyramid(self.image)

    @classmethod
    def of(cls, rgb: NDArray[np.uint8], config: SquaresConfig) -> "SquareCandidates":
        """The squares in an (H, W, 3) or grey (H, W) uint8 image; InputError if it is empty or of another type."""
        image, scale = _bounded(rgb, config.max_pixels)
        return cls(image, scale, find_quads(image, config))

    def of_plausible_size(self, frame: Frame, config: SquaresConfig) -> Self:
        """The squares in a frame's image that are as large as signs and codes, or whose distance is unknown."""
        corners = self.quads / self.scale
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
        columns, rows = corners.mean(axis=1).T.astype(np.intp)
        depth = np.where(frame.returns, frame.depth, np.nan)[rows, columns]
        size = sides * depth / frame.intrinsics.fx
        return replace(self, quads=self.quads[~((size < config.smallest) | (size > config.largest))])


def _bounded(rgb: NDArray[np.uint8], max_pixels: int) -> tuple[Rgb, float]:
    """An (H, W, 3) or grey (H, W) or (H, W, 1) uint8 image in three channels, shrunk to ``max_pixels`` or fewer.

    Returns:
        The image, and its side length relative to the original.

    Raises:
        InputError: the image is empty, or of another shape or type.
    """
    if rgb.dtype != np.uint8 or rgb.size == 0 or rgb.ndim not in (2, 3) or rgb.shape[2:] not in ((), (1,), (3,)):
        wanted = "non-empty uint8 array with shape (height, width), (height, width, 1) or (height, width, 3)"
        raise InputError(f"an image must be a {wanted}, not {rgb.dtype} with shape {rgb.shape}")
    image = np.repeat(rgb.reshape(*rgb.shape[:2], 1), 3, axis=2) if rgb.shape[2:] != (3,) else rgb
    scale = min(1.0, (max_pixels / (rgb.shape[0] * rgb.shape[1])) ** 0.5)
    if scale == 1.0:
        return image, scale
    size = tuple(max(1, round(scale * n)) for n in rgb.shape[1::-1])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8), scale


class Pyramid:
    """An image pyramid; each level halves the previous level, and is computed when it is first used."""

    def __init__(self, image: NDArray[np.uint8]):
        """Start with an (H, W, ...) image as level 0."""
        self._levels = [image]

    def __getitem__(self, level: int) -> NDArray[np.uint8]:
        """The image halved ``level`` times, by averaging areas."""
        while len(self._levels) <= level:
            last = self._levels[-1]
            size = (last.shape[1] + 1) // 2, (last.shape[0] + 1) // 2
            self._levels.append(np.asarray(cv2.resize(last, size, interpolation=cv2.INTER_AREA), np.uint8))
        return self._levels[level]


def corners_in(side: int) -> Pixels:
    """Four corners of the square inside the margin of a patch of ``side`` pixels."""
    low, high = MARGIN_FRACTION * side, (1 - MARGIN_FRACTION) * side
    return np.array([[low, low], [high, low], [high, high], [low, high]], np.float32)


def rectified(
    pyramid: Pyramid, quad: Pixels, side: int = PATCH_SIDE, interpolation: int = cv2.INTER_LINEAR
) -> NDArray[np.uint8]:
    """(side, side, ...) uint8 patch that shows a quadrilateral, four corners in pixels, as a square with a margin."""
    # Areas are averaged first, because a perspective transform samples single pixels.
    level = int(np.log2(max(*cv2.boundingRect(quad)[2:], side) / side))
    whole, image = pyramid[0].shape, pyramid[level]
    part = np.diag([whole[1] / image.shape[1], whole[0] / image.shape[0], 1])
    T = cv2.getPerspectiveTransform(quad, corners_in(side)) @ part
    patch = cv2.warpPerspective(image, T, (side, side), flags=interpolation, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(patch, np.uint8)
