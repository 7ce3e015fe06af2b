"""What is found: by a reader in one image, and on the map."""

import re
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Covariance, Pixels, Place, Rgb

VICTIM, HEAT = "victim", "heat"
KINDS = (VICTIM, "hazmat_sign", "qr_code", "april_tag", "fire_extinguisher", "door_lever", HEAT)
"""What a rescue robot looks for, as report.json has it; heat is what victims that are alive give off."""
FIND_KINDS = KINDS[1:]
"""All but victims, who have figures of their own."""
SHAPED = ("fire_extinguisher", "door_lever")
"""Kinds that are recognised by their shapes."""
OWN_KIND = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""How the kinds of a reader of one's own are written, as those above."""


@dataclass(frozen=True, eq=False)
class Reading:
    """An object in an image.

    Attributes:
        kind: one of ``KINDS``, or of a reader of one's own.
        text: the class of a sign or what a code says; empty if it cannot be read, or says nothing.
        corners: of its outline; none of a person of an earlier run.
        confidence: 0 to 1.
    """

    kind: str
    text: str
    corners: Pixels
    confidence: float

    @property
    def box(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 around the outline, pixels."""
        (x0, y0), (x1, y1) = self.corners.min(axis=0).tolist(), self.corners.max(axis=0).tolist()
        return x0, y0, x1, y1

    @property
    def side(self) -> float:
        """Pixels, the square root of the box's area."""
        x0, y0, x1, y1 = self.box
        return float(np.sqrt((x1 - x0) * (y1 - y0)))


@dataclass(frozen=True, eq=False)
class Find:
    """An object on the map, as it is reported.

    Attributes:
        kind: one of ``KINDS``.
        text: a class, or what a code says.
        position: in ``map``.
        covariance: of the position.
        time_s: s, when it was first seen.
        confidence: 0 to 1.
        photo: that shows it best.
        of_person: whether a person who is on the map gives it off, as heat; it lies where the person does.
    """

    kind: str
    text: str
    position: Place
    covariance: Covariance
    time_s: float
    confidence: float
    photo: Rgb
    of_person: bool = False


def box_corners(box: tuple[float, float, float, float]) -> Pixels:
    """Four corners of a box x0, y0, x1, y1, clockwise from the upper left, pixels."""
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], np.float32)


def is_find_kind(kind: str) -> bool:
    """Whether it can be the kind of a find, also of a reader of one's own; people are no finds."""
    return kind != VICTIM and OWN_KIND.fullmatch(kind) is not None
