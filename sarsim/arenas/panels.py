"""Finds wall panels inside other panels, for example where two neighbouring tiles both include the same wall."""

from collections import defaultdict
from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Values

SLACK = 1e-4  # m by which a panel may protrude from another panel and still lie inside it


def covered_panels(geoms: list[Element]) -> list[Element]:
    """The wall panels that lie inside another panel, which can be removed to avoid coincident faces.

    ``geoms``: all static geoms, in the world frame; boxes of class ``wall`` are the panels.
    """
    planes: dict[tuple[float, ...], list[tuple[Element, NDArray[np.float64]]]] = defaultdict(list)
    for geom in geoms:
        if geom.get("class") == "wall" and geom.get("mesh") is None:
            plane, outline = _panel(geom)
            planes[plane].append((geom, outline))
    return [geom for panels in planes.values() for geom in _covered(panels)]


def _panel(geom: Element) -> tuple[tuple[float, ...], NDArray[np.float64]]:
    """The plane of a panel, and its reach (4,) m backwards, forwards, downwards and upwards from the plane's origin.

    The plane is given by the panel's yaw in degrees, its offset along the normal and its half thickness, m.
    """
    (x, y, z), (along, thick, up) = numbers_of(geom, "pos"), numbers_of(geom, "size")
    w, *_, sin = numbers_of(geom, "quat")
    # A panel turned by 180° fills the same space.
    yaw = round(float(np.degrees(2 * np.arctan2(sin, w))), 2) % 180
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    middle = c * x + s * y
    outline = np.array([along - middle, along + middle, up - z, up + z])
    return (yaw, round(float(c * y - s * x), 3), round(float(thick), 4)), outline


def _covered(panels: list[tuple[Element, NDArray[np.float64]]]) -> list[Element]:
    """The panels that lie inside a larger panel; all panels are in one plane."""
    panels = sorted(panels, key=lambda panel: -float(panel[1].sum()))
    outlines = np.array([outline for _, outline in panels])
    inside = [(outlines[:n] >= outline - SLACK).all(axis=1).any() for n, outline in enumerate(outlines)]
    return [geom for (geom, _), covered in zip(panels, inside, strict=True) if covered]


def numbers_of(element: Element, attribute: str, default: Sequence[float] = ()) -> Values:
    """The numbers in an attribute of an element; ``default`` if the attribute is missing."""
    text = element.get(attribute)
    return np.array(default if text is None else text.split(), np.float64)
