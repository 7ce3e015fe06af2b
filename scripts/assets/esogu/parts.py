"""Parts of furniture and of the building: labelled boxes and cylinders with their poses."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from sarsim.victims.mjcf import numbers

Point = tuple[float, float, float]
ROUNDING = 1e-9  # A yaw closer to 0 than this counts as 0, deg


@dataclass(frozen=True)
class Part:
    """A box or a cylinder.

    Attributes:
        label: name of the MJCF default class, which sets the label.
        material: name of the MJCF material.
        middle: x, y, z of the centre, m.
        extent: full lengths along its own x, y, z, m; for either cylinder: diameter, diameter, length.
        yaw: rotation about z, counter-clockwise from above, deg.
        shape: box or cylinder. At yaw 0, the axis of a cylinder is along z, that of a lying cylinder along y.
        solid: whether the robot can collide with the part.
    """

    label: str
    material: str
    middle: Point
    extent: Point
    yaw: float = 0.0
    shape: Literal["box", "cylinder", "lying_cylinder"] = "box"
    solid: bool = True

    def moved(self, x: float, y: float, yaw: float) -> "Part":
        """The part turned left about the origin by ``yaw`` (deg), then shifted by ``x``, ``y`` (m)."""
        turn = np.radians(yaw)
        px, py, pz = self.middle
        middle = (x + np.cos(turn) * px - np.sin(turn) * py, y + np.sin(turn) * px + np.cos(turn) * py, pz)
        return replace(self, middle=middle, yaw=(self.yaw + yaw) % 360)

    def element(self, name: str) -> Element:
        """The part as an MJCF geom."""
        words = {"name": name, "class": self.label, "material": self.material, "pos": numbers(self.middle)}
        half = np.array(self.extent) / 2
        if self.shape == "box":
            words["size"] = numbers(half)
        else:
            words |= {"type": "cylinder", "size": numbers([half[0], half[2]])}
        if (quat := self._quat()) is not None:
            words["quat"] = quat
        if not self.solid:
            words |= {"contype": "0", "conaffinity": "0"}
        return Element("geom", words)

    def _quat(self) -> str | None:
        half = np.radians(self.yaw) / 2
        if self.shape == "lying_cylinder":  # A cylinder's own axis is z: first turn it to y
            return numbers(np.sqrt(0.5) * np.array([np.cos(half), -np.cos(half), -np.sin(half), np.sin(half)]))
        if abs(self.yaw) < ROUNDING or self.shape == "cylinder":
            return None
        return numbers([np.cos(half), 0, 0, np.sin(half)])


def moved(parts: Iterable[Part], x: float, y: float, yaw: float) -> list[Part]:
    """All parts turned left by ``yaw`` (deg), then shifted by ``x``, ``y`` (m)."""
    return [part.moved(x, y, yaw) for part in parts]
