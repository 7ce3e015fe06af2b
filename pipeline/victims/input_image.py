"""Prepare a camera image for the network: compensate uneven lighting, and fit the image into the network's input.

Parts of the image with dark surroundings are brightened to a common level, so that people look alike in daylight, in
dim light and at the edge of a lamp's cone. This is a retinex method (Land, "The retinex theory of color vision",
Scientific American 237, 1977), with the cells of a coarse grid as the surroundings.
"""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb

GREY = 128  # Brightness of the bars next to a fitted image, as in Darknet's letterbox_image
CELLS = 16, 12
"""Columns and rows of the coarse grid that holds the brightness of the surroundings."""
BLUR = 2.0
"""Standard deviation of the Gaussian that smooths the grid, cells; dark objects stay dark, dark regions do not."""
BRIGHTNESS = 130.0
"""Value, of 255, to which the brightest channel of the surroundings is raised if it is lower."""
DARKEST = 12.0
"""Brightness, of 255, below which the gain does not increase further, because darker regions contain only noise."""


def evenly_exposed(rgb: Rgb) -> Rgb:
    """An image with uneven lighting compensated; a well-lit image is not changed."""
    light = cv2.resize(rgb, CELLS, interpolation=cv2.INTER_AREA).max(axis=2).astype(np.float32)
    light = cv2.GaussianBlur(light, (0, 0), BLUR, borderType=cv2.BORDER_REPLICATE)
    gain = np.maximum(BRIGHTNESS / np.maximum(light, DARKEST), 1)
    gain = cv2.resize(gain, rgb.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    bright = cv2.multiply(rgb, cv2.merge([gain] * 3), dtype=cv2.CV_8U)
    return np.asarray(bright, np.uint8)


def scaled(rgb: Rgb, ratio: float) -> Rgb:
    """An image scaled by ``ratio``, at least one pixel wide and high."""
    rows, columns = rgb.shape[:2]
    size = max(1, round(columns * ratio)), max(1, round(rows * ratio))
    how = cv2.INTER_AREA if ratio < 0.5 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(rgb, size, interpolation=how), np.uint8)


@dataclass(frozen=True)
class Letterbox:
    """Scale and position of an image in the network's input, into which it is fitted with its aspect ratio kept.

    Attributes:
        scale: pixels of the input per pixel of the image, in x and y; the two differ only by rounding.
        corner: x and y of the image's upper left corner in the input, pixels.
        size: width and height of the image, pixels.
    """

    scale: tuple[float, float]
    corner: tuple[int, int]
    size: tuple[int, int]

    @classmethod
    def fit(cls, image: Rgb, width: int, height: int) -> tuple[Self, Rgb]:
        """Fit an image into the middle of an input of width × height pixels; return the letterbox and the input."""
        rows, columns = image.shape[:2]
        small = scaled(image, min(width / columns, height / rows))
        h, w = small.shape[:2]
        left, top = (width - w) // 2, (height - h) // 2
        canvas = np.full((height, width, 3), GREY, np.uint8)
        canvas[top : top + h, left : left + w] = small
        return cls((w / columns, h / rows), (left, top), (columns, rows)), canvas

    def to_image(self, boxes: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N, 4) float32 boxes in the image, clipped at its edges, from (N, 4) boxes in the input."""
        points = (boxes.reshape(-1, 2, 2) - self.corner) / self.scale
        return np.clip(points, 0, self.size).reshape(-1, 4).astype(np.float32)
