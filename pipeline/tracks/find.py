"""Objects as a reader finds them in one image, and as they are reported on the map."""

import re
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Covariance, Pixels, Place, Rgb

VICTIM, HEAT = "victim", "heat"
KINDS = (VICTIM, "hazmat_sign", "qr_code", "april_tag", "fire_extinguisher", "door_lever", HEAT)
"""The kinds of objects that a rescue robot looks for, as named in report.json; living victims give off heat."""
FIND_KINDS = KINDS[1:]
"""All kinds except victims, which are reported separately."""
KINDS_WITH_SHAPE = ("fire_extinguisher", "door_lever")
"""Kinds that are recognised by their shape."""
KIND_PATTERN = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""Pattern of valid names for the kinds of a user's own readers, in the style of the names above."""
HAZMAT_CLASSES = (
    "corrosive", "dangerous-when-wet", "explosive", "flammable", "flammable-gas", "flammable-liquid",
    "flammable-solid", "infectious-substance", "inhalation-hazard", "non-flammable-gas", "organic-peroxide",
    "oxidizer", "oxygen", "poison", "radioactive", "spontaneously-combustible",
)  # fmt: skip
"""The classes of hazmat signs, as rescue teams name them."""
MAX_TEXT = 40
"""Maximum length of a code's text where it is displayed, characters."""


@dataclass(frozen=True, eq=False)
class Reading:
    """An object in an image.

    Attributes:
        kind: one of ``KINDS``, or a kind of a user's own reader.
        text: the class of a sign or the content of a code; empty if the text cannot be read, or if there is none.
        corners: corners of the outline.
        confidence: confidence from 0 to 1.
    """

    kind: str
    text: str
    corners: Pixels
    confidence: float

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Bounding box x0, y0, x1, y1 of the outline, pixels."""
        (x0, y0), (x1, y1) = self.corners.min(axis=0).tolist(), self.corners.max(axis=0).tolist()
        return x0, y0, x1, y1

    @property
    def side(self) -> float:
        """Square root of the box's area, pixels."""
        x0, y0, x1, y1 = self.box
        return float(np.sqrt((x1 - x0) * (y1 - y0)))


@dataclass(frozen=True, eq=False)
class Find:
    """An object on the map, as reported.

    Attributes:
        kind: one of ``KINDS``, or a kind of a user's own reader.
        text: the class of a sign or the content of a code.
        position: position in ``map``.
        covariance: (3, 3) covariance of the position, m².
        time_s: time at which the object was first seen in this run, s; NaN if only an earlier run saw the object.
        confidence: confidence from 0 to 1.
        photo: the photo that shows the object best.
        is_heat_of_person: whether the find is heat from a person on the map; its position is then the person's.
    """

    kind: str
    text: str
    position: Place
    covariance: Covariance
    time_s: float
    confidence: float
    photo: Rgb
    is_heat_of_person: bool = False


def box_corners(box: tuple[float, float, float, float]) -> Pixels:
    """Four corners of a box x0, y0, x1, y1, clockwise from the upper left, pixels."""
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], np.float32)


def is_find_kind(kind: str) -> bool:
    """Whether a name can be the kind of a find, for example of a user's own reader; people are not finds."""
    return kind != VICTIM and KIND_PATTERN.fullmatch(kind) is not None


def is_same(one: Pixels, other: Pixels) -> bool:
    """Whether more than half of the smaller of two outlines lies in the other."""
    return overlap_ratios(one, other)[1] > 0.5


def overlap_ratios(one: Pixels, other: Pixels) -> tuple[float, float]:
    """Ratios of the area that two outlines share to the area of their union and to the area of the smaller one."""
    common, _ = cv2.intersectConvexConvex(cv2.convexHull(one), cv2.convexHull(other))
    areas = cv2.contourArea(one), cv2.contourArea(other)
    return common / max(sum(areas) - common, 1), common / max(min(areas), 1)


def plain_text(text: str) -> str:
    """A code's text on one line of at most ``MAX_TEXT`` printable characters; "…" replaces the rest."""
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text[: MAX_TEXT + 1])
    return shown if len(shown) <= MAX_TEXT else shown[: MAX_TEXT - 1] + "…"
