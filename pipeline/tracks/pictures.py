"""Crops of images for display."""

import numpy as np

from pipeline.arrays import Rgb


def photo_of(rgb: Rgb, box: tuple[float, float, float, float], margin: float) -> Rgb:
    """A copy of an image within a box, pixels, plus a ``margin`` as a fraction of the box's longer side."""
    x0, y0, x1, y1 = box
    more = margin * max(x1 - x0, y1 - y0)
    rows = slice(max(0, int(y0 - more)), int(np.ceil(y1 + more)))
    return rgb[rows, max(0, int(x0 - more)) : int(np.ceil(x1 + more))].copy()
