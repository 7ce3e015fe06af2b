"""The legend of a recording's colours, as an image with its own background, so that it suits any theme."""

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.labels import COLOURS, Label
from pipeline.rerun import drawings
from pipeline.rerun.victim_drawings import CONFIRMED, REFUSED, UNCONFIRMED

ROW, PATCH, WIDTH = 26, 34, 330  # Pixels: a line's height, a colour's width, a column's width
PAPER, INK = 245, (20, 20, 20)
MEANINGS = {
    **{f"{label.name.lower().replace('_', ' ')} (class)": tuple(COLOURS[label].tolist()) for label in Label},
    "path to the next viewpoint": drawings.PLAN_COLOUR,
    "frontier: unseen ground begins": drawings.FRONTIER_COLOUR,
    "edge of the topological map": drawings.EDGE_COLOUR,
    "keyframe, arrow ahead": drawings.KEYFRAME_COLOUR,
    "way as it is believed": drawings.TRAJECTORY_COLOUR,
    "true way": drawings.TRUE_TRACK_COLOUR,
    "loop: the same place again": drawings.LOOP_COLOUR,
    "person, with number": CONFIRMED,
    "sighting, with letter": UNCONFIRMED,
    "detection that is no person": REFUSED,
}
"""RGB colour of each meaning."""


def legend() -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB, in two columns."""
    rows = (len(MEANINGS) + 1) // 2
    picture = np.full((rows * ROW + 10, 2 * WIDTH, 3), PAPER, np.uint8)
    for k, (meaning, colour) in enumerate(MEANINGS.items()):
        x, y = k // rows * WIDTH + 10, k % rows * ROW + 8
        cv2.rectangle(picture, (x, y), (x + PATCH, y + ROW - 8), colour, -1)
        cv2.rectangle(picture, (x, y), (x + PATCH, y + ROW - 8), INK, 1)
        cv2.putText(picture, meaning, (x + PATCH + 10, y + 15), cv2.FONT_HERSHEY_SIMPLEX, 0.5, INK, 1, cv2.LINE_AA)
    return picture
