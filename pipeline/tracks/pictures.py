"""Images as the readers of finds take them, three channels and not too large, and parts of them to show."""

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

READ_PIXELS = 1 << 21
"""Pixels of an image that is read; a larger one is made smaller, so that it takes no longer than 1600 × 1200."""


def bounded(rgb: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], float]:
    """An (H, W, 3) or grey (H, W) or (H, W, 1) uint8 image in three channels of READ_PIXELS at most.

    Returns:
        The image, and its pixels over those of the original along a side.

    Raises:
        InputError: it is empty, of another shape or type.
    """
    if rgb.dtype != np.uint8 or rgb.size == 0 or rgb.ndim not in (2, 3) or rgb.shape[2:] not in ((), (1,), (3,)):
        raise InputError(
            f"image: {rgb.dtype} of shape {rgb.shape}, not uint8 of (height, width) or (height, width, 3)"
        )
    image = np.repeat(rgb.reshape(*rgb.shape[:2], 1), 3, axis=2) if rgb.shape[2:] != (3,) else rgb
    scale = min(1.0, (READ_PIXELS / (rgb.shape[0] * rgb.shape[1])) ** 0.5)
    if scale == 1.0:
        return image, scale
    size = tuple(max(1, round(scale * n)) for n in rgb.shape[1::-1])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8), scale


def photo_of(rgb: NDArray[np.uint8], box: tuple[float, float, float, float], margin: float) -> NDArray[np.uint8]:
    """A copy of an image (H, W, 3) within a box, pixels, and a margin around it, a share of its longer side."""
    x0, y0, x1, y1 = box
    more = margin * max(x1 - x0, y1 - y0)
    rows = slice(max(0, int(y0 - more)), int(np.ceil(y1 + more)))
    return rgb[rows, max(0, int(x0 - more)) : int(np.ceil(x1 + more))].copy()
