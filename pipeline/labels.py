"""The semantic classes of points."""

from enum import IntEnum
from math import radians

import numpy as np
from PIL import ImageColor


class Label(IntEnum):
    """Semantic classes; the thesis's four are 1 to 4. A geom carries its id as ``user`` data in the MJCF."""

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
"""The words for the classes in everything that people read; files have the names of the labels."""

THESIS_FOUR = (Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP)
PLANAR = (*THESIS_FOUR, Label.CEILING)  # Classes made of planes

RAMP_TILT = radians(8)
"""Tilt above which a surface is an inclined ramp, rad, for the robot as for the ground truth."""

_NAMES = ("gray", "crimson", "gold", "royalblue", "hotpink", "lightgray", "forestgreen", "sienna")
COLOURS = np.array([ImageColor.getrgb(name) for name in _NAMES], np.uint8)
"""(8, 3) uint8 RGB, indexed by label: CSS's colours."""
PERSON_COLOUR = _NAMES[Label.VICTIM]
"""CSS's name of the colour in which people are drawn, wherever they are."""
