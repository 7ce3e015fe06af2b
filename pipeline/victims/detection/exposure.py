"""Light evened out: what the lamp does not reach is made brighter, as the eye does and a single exposure cannot.

Every part of the image whose surroundings are darker is brought to one brightness, so that people look alike in the
light of day, in dim light and at the edge of a lamp's cone. In the manner of a retinex (Land, "The retinex theory of
color vision", Scientific American 237, 1977), with a coarse grid of cells as the surroundings.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

CELLS = (16, 12)
"""Of the grid, along x and y."""
BLUR = 2.0
"""cells, standard deviation of the Gaussian over the grid: dark things stay dark, dark places do not."""
BRIGHTNESS = 130.0
"""Of 255, to which the brightest channel is brought where it is less."""
DARKEST = 12.0
"""Of 255; where there is less light there is nothing but noise to make brighter."""


def evenly_exposed(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An (H, W, 3) image in even light; one that is lit well stays as it is."""
    light = cv2.resize(rgb, CELLS, interpolation=cv2.INTER_AREA).max(axis=2).astype(np.float32)
    light = cv2.GaussianBlur(light, (0, 0), BLUR, borderType=cv2.BORDER_REPLICATE)
    gain = np.maximum(BRIGHTNESS / np.maximum(light, DARKEST), 1)
    gain = cv2.resize(gain, rgb.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    bright = cv2.multiply(rgb, cv2.merge([gain] * 3), dtype=cv2.CV_8U)
    return np.asarray(bright, np.uint8)
