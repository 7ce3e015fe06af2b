"""The legend of a recording's colours, as an image whose own background makes it legible in any theme."""

import numpy as np

from pipeline.arrays import Rgb
from pipeline.labels import COLOURS, PLAIN_NAMES, Label
from pipeline.lettering import width_of, write
from pipeline.rerun import drawings
from pipeline.rerun.find_drawings import FIND_COLOUR
from pipeline.rerun.victim_drawings import CONFIRMED, REFUSED, UNCONFIRMED

BACKGROUND, INK = (24, 27, 31), (235, 235, 235)
SIZE, LINE, PATCH, GAP = 17, 27, 16, 9
"""Height of the letters, of a line and of a patch of colour, and the gap between patch and text, pixels."""
MEANINGS = {
    **{PLAIN_NAMES[label]: tuple(COLOURS[label].tolist()) for label in Label},
    "path to the next viewpoint": drawings.PLAN_COLOUR,
    "frontier of unseen ground": drawings.FRONTIER_COLOUR,
    "edge of the topological map": drawings.EDGE_COLOUR,
    "keyframe (arrow: heading)": drawings.KEYFRAME_COLOUR,
    "estimated path": drawings.TRAJECTORY_COLOUR,
    "true path": drawings.TRUE_TRAJECTORY_COLOUR,
    "loop closure": drawings.LOOP_COLOUR,
    "person, path to the person": CONFIRMED,
    "unconfirmed sighting": UNCONFIRMED,
    "rejected detection": REFUSED,
    "sign, code or other find": FIND_COLOUR,
}
"""RGB colour of each meaning."""


def legend() -> Rgb:
    """The image of the legend, in two columns."""
    rows = (len(MEANINGS) + 1) // 2
    column = 3 * GAP + PATCH + max(width_of(meaning, SIZE) for meaning in MEANINGS)
    picture = np.full((rows * LINE + GAP, 2 * column + GAP, 3), BACKGROUND, np.uint8)
    for k, (meaning, colour) in enumerate(MEANINGS.items()):
        x, y = k // rows * column + 2 * GAP, k % rows * LINE + GAP
        picture[y : y + PATCH, x : x + PATCH] = colour
        write(picture, (x + PATCH + GAP, y + PATCH - 2), meaning, SIZE, INK)
    return picture
