"""The ways of a drive from above: where the robot truly was, and where each method has it."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from sarsim.ground_truth.true_surface import TrueSurface
from sarsim.scripts.benchmarks.top_view import BAND, caption, ground_picture, pixels

COLOURS = {
    "odometry": (150, 150, 150),
    "open3d": (230, 140, 0),
    "kiss_icp": (150, 60, 200),
    "ours_without_loops": (60, 170, 230),
    "ours": (0, 130, 60),
    "true": (0, 0, 0),
}
"""RGB of the methods; the last ones are drawn over the others."""


def picture_of(surface: TrueSurface, ways: Mapping[str, NDArray[np.float64]], text: str) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB, x to the right and y up.

    Args:
        surface: the true ground.
        ways: (N, 2 or 3) m in the world, by the names of ``COLOURS``.
        text: for the line below, under that which names the colours.
    """
    picture, scale = ground_picture(surface, surface.drivable)
    for name, colour in COLOURS.items():
        if name in ways:
            way = pixels(surface.grid, scale, ways[name][:, :2])
            cv2.polylines(picture, [way], False, colour, 1 + (name != "true"), cv2.LINE_AA)
    width, names = picture.shape[1], [name for name in reversed(COLOURS) if name in ways]
    return np.vstack([picture, _legend(names, width), caption(text, width)])


def _legend(names: list[str], width: int) -> NDArray[np.uint8]:
    """(BAND, width, 3) the names in their colours."""
    band = np.full((BAND, width, 3), 255, np.uint8)
    font, size, x = cv2.FONT_HERSHEY_SIMPLEX, 0.45, 6
    for name in names:
        text = name.replace("_", " ")
        cv2.putText(band, text, (x, BAND - 9), font, size, COLOURS[name], 1, cv2.LINE_AA)
        x += cv2.getTextSize(text, font, size, 1)[0][0] + 20
    return band
