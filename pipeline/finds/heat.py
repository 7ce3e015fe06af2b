"""Finds what is warm in the image of a thermal camera."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.tracks.find import Reading

WARM = 5.0
"""°C above the median of the image from which something is warm: clothes on a living person are 6 to 8 °C above the
air of a room, the noise of an uncooled camera is 0.05 °C."""


def warm_regions(thermal: NDArray[np.float32], height: int) -> Iterator[Reading]:
    """The warm regions of a thermal image (h, w), °C, as readings in the colour image, ``height`` pixels high."""
    warm = np.isfinite(thermal) & (thermal > np.nanmedian(thermal) + WARM)
    scale = height / thermal.shape[0]
    contours, _ = cv2.findContours(warm.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        if len(contour) > 3:  # fewer pixels may be a lamp or a hot spot of the sensor
            middles = cv2.convexHull(contour)[:, 0] + np.float32(0.5)
            yield Reading("heat", "", (middles * scale).astype(np.float32), 1.0)
