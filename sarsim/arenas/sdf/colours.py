"""The colour of a shape: of a visual's own material, or by the name of one that comes with Gazebo."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Colour = tuple[float, float, float]
_NAMED: dict[str, Colour] = {
    "Grey": (0.7, 0.7, 0.7), "DarkGrey": (0.175, 0.175, 0.175), "White": (1, 1, 1), "Black": (0, 0, 0),
    "FlatBlack": (0.1, 0.1, 0.1), "Red": (1, 0, 0), "Green": (0, 1, 0), "Blue": (0, 0, 1), "Yellow": (1, 1, 0),
    "Orange": (1, 0.51, 0.05), "Purple": (1, 0, 1), "Turquoise": (0, 1, 1),
}  # fmt: skip
"""Diffuse colours of the plain materials ``Gazebo/NAME``, from Gazebo's media/materials/scripts/gazebo.material."""


def colour_of(shape: "Element", visuals: "Sequence[Element]") -> Colour | None:
    """The colour of a shape: its own, of the visual with the same geometry, or of the first of the link's visuals."""
    alike = [visual for visual in visuals if _form(visual) == _form(shape)]
    return next((colour for owner in (shape, *alike, *visuals[:1]) if (colour := _material(owner))), None)


def _form(shape: "Element") -> list[str]:
    """The texts of a shape's pose and geometry, by which two are compared."""
    parts = [part for tag in ("pose", "geometry") for part in shape.iterfind(tag)]
    return [f"{e.tag} {' '.join((e.text or '').split())}" for part in parts for e in part.iter()]


def _material(shape: "Element") -> Colour | None:
    material = shape.find("material")
    if material is None:
        return None
    name = (material.findtext("script/name") or "").strip()
    named = _NAMED.get(name.removeprefix("Gazebo/"))
    written = [material.findtext(tag) for tag in ("diffuse", "ambient")]
    return named or next((colour for text in written if (colour := _written(text))), None)


def _written(text: str | None) -> Colour | None:
    """The colour that a text gives; None if it gives none: a wrong colour stops no world."""
    try:
        red, green, blue = np.clip([float(word) for word in (text or "").split()[:3]], 0.0, 1.0).tolist()
    except ValueError:
        return None
    return (red, green, blue) if np.isfinite((red, green, blue)).all() else None
