"""The legend of a recording's colours, as an image with its own background that suits any theme."""

import cv2
import numpy as np
from PIL import ImageColor

from pipeline.arrays import Rgb
from pipeline.labels import COLOURS, PLAIN_NAMES, Label
from pipeline.rerun import drawings
from pipeline.rerun.drawings import FONT
from pipeline.rerun.find_drawings import FIND_COLOUR
from pipeline.rerun.victim_drawings import CONFIRMED, REFUSED, UNCONFIRMED

PAPER, INK = ImageColor.getrgb("whitesmoke"), ImageColor.getrgb("black")
MEANINGS = {
    **{PLAIN_NAMES[label]: tuple(COLOURS[label].tolist()) for label in Label},
    "path to the next viewpoint": drawings.PLAN_COLOUR,
    "frontier of unseen ground": drawings.FRONTIER_COLOUR,
    "edge of the topological map": drawings.EDGE_COLOUR,
    "keyframe (arrow: heading)": drawings.KEYFRAME_COLOUR,
    "estimated path": drawings.TRAJECTORY_COLOUR,
    "true path": drawings.TRUE_TRACK_COLOUR,
    "loop closure": drawings.LOOP_COLOUR,
    "person, path to the person": CONFIRMED,
    "unconfirmed sighting": UNCONFIRMED,
    "rejected detection": REFUSED,
    "sign, code or other find": FIND_COLOUR,
}
"""RGB colour for each meaning."""


def legend() -> Rgb:
    """The legend, in two columns with lines twice as high as their text."""
    sizes = [cv2.getTextSize(meaning, *FONT, thickness=1)[0] for meaning in MEANINGS]
    width, height = np.max(sizes, axis=0).tolist()
    line, rows = 2 * height, (len(MEANINGS) + 1) // 2
    column = line + height + width + height
    picture = np.full((rows * line + height, 2 * column + height, 3), PAPER, np.uint8)
    for k, (meaning, colour) in enumerate(MEANINGS.items()):
        x, y = k // rows * column + height, k % rows * line + height
        patch = (x, y), (x + line, y + height)
        cv2.rectangle(picture, *patch, colour, cv2.FILLED)
        cv2.rectangle(picture, *patch, INK)
        cv2.putText(picture, meaning, (x + line + height, y + height), *FONT, INK, 1, cv2.LINE_AA)
    return picture
