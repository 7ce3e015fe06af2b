"""The semantic classes of points."""

from enum import IntEnum
from math import radians

import numpy as np
from PIL import ImageColor


class Label(IntEnum):
    """Semantic classes; classes 1 to 4 are the thesis's. In the MJCF, the ``user`` data of a geom hold its class."""

    UNLABELLED = 0
    WALL = 1
    TERRAIN = 2
    INCLINED_RAMP = 3
    STRAIGHT_RAMP = 4
    CEILING = 5
    VICTIM = 6
    CLUTTER = 7


PLAIN_NAMES = {
    Label.UNLABELLED: "not classified",
    Label.WALL: "wall",
    Label.TERRAIN: "ground",
    Label.INCLINED_RAMP: "slope",
    Label.STRAIGHT_RAMP: "raised deck",
    Label.CEILING: "ceiling",
    Label.VICTIM: "person",
    Label.CLUTTER: "clutter",
}
"""The names of the classes in text for readers; files use the names of the labels."""

THESIS_FOUR = (Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP)
PLANAR = (*THESIS_FOUR, Label.CEILING)  # Classes made of planes

RAMP_TILT = radians(8)
"""Tilt above which a surface is an inclined ramp, rad, both for the robot and in the ground truth."""

_NAMES = ("gray", "crimson", "gold", "royalblue", "hotpink", "lightgray", "forestgreen", "sienna")
COLOURS = np.array([ImageColor.getrgb(name) for name in _NAMES], np.uint8)
"""(8, 3) uint8 RGB colours of CSS, indexed by label."""
PERSON_COLOUR = _NAMES[Label.VICTIM]
"""CSS name of the colour in which people are always drawn."""
