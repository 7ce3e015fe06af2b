"""Find warm regions in the image of a thermal camera."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.tracks.find import HEAT, Reading
from pipeline.victims.config import HeatConfig


def warm_regions(thermal: NDArray[np.float32], height: int, config: HeatConfig) -> Iterator[Reading]:
    """The warm regions of a thermal image (h, w), °C, as readings in the colour image, ``height`` pixels high."""
    warm = np.isfinite(thermal) & (thermal > np.nanmedian(thermal) + config.warmer)
    scale = height / thermal.shape[0]
    contours, _ = cv2.findContours(warm.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        if len(contour) >= config.least_outline:
            middles = cv2.convexHull(contour)[:, 0] + np.float32(0.5)
            yield Reading(HEAT, "", (middles * scale).astype(np.float32), 1.0)
