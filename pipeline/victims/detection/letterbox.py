"""An image fitted into a network's input without changing its proportions."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

GREY = 128  # of the bars, as Darknet's letterbox_image


@dataclass(frozen=True)
class Letterbox:
    """Where an image lies in the input.

    Attributes:
        scale: pixels of the input a pixel of the image, in x and y; the two differ by rounding alone.
        corner: x, y of its upper left corner in the input, pixels.
        size: width, height of the image.
    """

    scale: tuple[float, float]
    corner: tuple[int, int]
    size: tuple[int, int]

    @classmethod
    def fit(cls, image: NDArray[np.uint8], width: int, height: int) -> tuple[Self, NDArray[np.uint8]]:
        """As large as it can be in the middle of ``width`` × ``height``; with the input itself."""
        rows, columns = image.shape[:2]
        ratio = min(width / columns, height / rows)
        w, h = max(1, round(columns * ratio)), max(1, round(rows * ratio))
        left, top = (width - w) // 2, (height - h) // 2
        small = cv2.resize(image, (w, h), interpolation=cv2.INTER_AREA if ratio < 0.5 else cv2.INTER_LINEAR)
        canvas = np.full((height, width, 3), GREY, np.uint8)
        canvas[top : top + h, left : left + w] = small
        return cls((w / columns, h / rows), (left, top), (columns, rows)), canvas

    def to_image(self, boxes: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N, 4) boxes of the input as boxes of the image, cut at its edges."""
        points = (boxes.reshape(-1, 2, 2) - self.corner) / self.scale
        return np.clip(points, 0, self.size).reshape(-1, 4).astype(np.float32)
