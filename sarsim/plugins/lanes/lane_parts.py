"""The parts of lanes: framed floors, which may be tilted, and the objects on them, which tilt with them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, radians, sin
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Place, Rotation3
from pipeline.errors import required
from sarsim.arenas.elements import ArenaBuilder, Attributes
from sarsim.plugins.lanes.lanes import DIMENSIONS as D

TIMBER = (0.76, 0.60, 0.38)
Triple = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Deck:
    """The coordinate frame of a floor: x along the lane, y to the left, z = 0 at the surface.

    Attributes:
        builder: builder of the arena.
        origin: origin in the world, m.
        R: (3, 3) rotation from the deck's frame to the world, by default the identity.
    """

    builder: ArenaBuilder
    origin: Place
    R: Rotation3 = field(default_factory=lambda: np.eye(3))

    def point(self, x: float, y: float, z: float = 0.0) -> Place:
        """World coordinates, m, of a point in the deck's frame, m."""
        return self.origin + self.R @ np.array([x, y, z])

    def pose(self, middle: Triple, R: Rotation3) -> dict[str, NDArray[np.float64]]:
        """MJCF attributes for a position, m, and a (3, 3) rotation, both in the deck's frame."""
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, (self.R @ R).ravel())
        return {"pos": self.point(*middle), "quat": quat}

    def add_box(
        self, label: str, middle: Triple, size: Triple, yaw: float = 0.0, colour: Sequence[float] | None = None
    ) -> None:
        """Add a box of full size ``size``, m, with its centre at ``middle``, m, turned left by ``yaw`` rad."""
        self.builder.add_geom(
            label, {**self.pose(middle, rotation(yaw)), "type": "box", "size": np.array(size) / 2}, colour
        )

    def add_hull(
        self, label: str, at: Triple, vertices: NDArray[np.float64], colour: Sequence[float] | None = None
    ) -> None:
        """Add the convex hull of vertices (N, 3), m, given relative to the position ``at``, m."""
        mesh = self.builder.add_mesh(vertices)
        self.builder.add_geom(label, {**self.pose(at, np.eye(3)), "type": "mesh", "mesh": mesh}, colour)

    def railing(self, x: float, y: float, yaw: float) -> None:
        """Add a railing with its centre at ``x``, ``y``, m, that runs in direction ``yaw``, rad."""
        thick, high = D.lumber
        for top in D.bars:
            self.add_box("wall", (x, y, top - high / 2), (D.railing, thick, high), yaw, TIMBER)
        for end in (-1, 1):
            away = end * (D.railing - high) / 2
            place = x + away * cos(yaw), y + away * sin(yaw), D.bars[-1] / 2
            self.add_box("wall", place, (high, thick, D.bars[-1]), yaw, TIMBER)

    def set_start(self, x: float, y: float, yaw: float) -> None:
        """Let the robot start at ``x``, ``y``, m, with heading ``yaw``, rad."""
        self.builder.set_start(self.point(x, y), 0.0)
        site = required(self.builder.root.find("worldbody/site[@name='start']"))
        site.set("quat", " ".join(f"{n:.9g}" for n in self.pose((x, y, 0.0), rotation(yaw))["quat"]))


def rotation(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> Rotation3:
    """(3, 3) rotation by a yaw to the left, a pitch that raises the front and a roll that raises the left, rad."""
    (a, b), (c, d), (e, f) = ((cos(t), sin(t)) for t in (yaw, pitch, roll))
    Rz = np.array([(a, -b, 0), (b, a, 0), (0, 0, 1.0)])
    Ry = np.array([(c, 0, -d), (0, 1.0, 0), (d, 0, c)])
    Rx = np.array([(1.0, 0, 0), (0, e, -f), (0, f, e)])
    return Rz @ Ry @ Rx


def add_floor(deck: Deck, length: float = D.floor, width: float = D.width) -> None:
    """Add a floor, a board on a frame of ``length`` × ``width`` m, with its surface at the deck's z = 0."""
    deep = D.framing + D.board
    label = "terrain" if deck.R[2, 2] == 1 else "inclined_ramp"
    deck.add_box(label, (0.0, 0.0, -deep / 2), (length, width, deep))


def add_hall(builder: ArenaBuilder, low: Sequence[float], high: Sequence[float], below: float) -> None:
    """Add the hall around a lane: a floor between two corners (2,) m, ``below`` m under z = 0, lights and cameras."""
    middle, half = np.add(low, high) / 2, np.subtract(high, low) / 2
    builder.add_geom("terrain", {"pos": (*middle, -below), "size": (*half, 0.1)})
    builder.add_surroundings(low, high)


def add_four_floors(builder: ArenaBuilder, ridge: bool = False) -> list[Deck]:
    """Add four floors with railings around them; the middle two are level or rise to a ridge.

    Two of a lane's 14 railings are gates, which are closed here. It is assumed that the slopes meet in a ridge.
    """
    tilt = radians(D.slope) if ridge else 0.0
    run, rise = D.floor * cos(tilt), D.floor * sin(tilt)
    decks = [
        Deck(builder, np.array([-run - D.floor / 2, D.offset, 0.0])),
        Deck(builder, np.array([-run / 2, 0.0, rise / 2]), rotation(0.0, tilt)),
        Deck(builder, np.array([run / 2, 0.0, rise / 2]), rotation(0.0, -tilt)),
        Deck(builder, np.array([run + D.floor / 2, -D.offset, 0.0])),
    ]
    for deck in decks:
        add_floor(deck)
        add_side_railings(deck)
    add_end_railings(decks)
    add_hall(builder, (-4.4, -3.2), (4.4, 3.2), D.framing + D.board)
    return decks


def add_side_railings(deck: Deck) -> None:
    """Add the railings on both sides of a floor."""
    for side in (-1, 1):
        deck.railing(0.0, side * (D.width + D.lumber[0]) / 2, 0.0)


def add_end_railings(decks: Sequence[Deck]) -> None:
    """Add the railings at both ends of a row of floors."""
    for deck, end in ((decks[0], -1), (decks[-1], 1)):
        for side in (-1, 1):
            deck.railing(end * (D.floor + D.lumber[0]) / 2, side * D.railing / 2, radians(90))


def add_body(builder: ArenaBuilder, name: str, pos: Sequence[float], joint: Attributes, geom: Attributes) -> Element:
    """Add a movable body at ``pos`` (3,) m with one joint and one geom of class wall, given as MJCF attributes."""
    added = SubElement(required(builder.root.find("worldbody")), "body", name=name, pos=mjcf_numbers(pos))
    SubElement(added, "joint", {"name": f"{name}_joint"} | mjcf_texts(joint))
    SubElement(added, "geom", {"name": name, "class": "wall"} | mjcf_texts(geom))
    return added


def mjcf_texts(attributes: Attributes) -> dict[str, str]:
    """Attributes as MJCF text."""
    return {name: value if isinstance(value, str) else mjcf_numbers(value) for name, value in attributes.items()}


def mjcf_numbers(values: object) -> str:
    """Numbers as MJCF text."""
    return " ".join(f"{v:.6g}" for v in np.ravel(np.asarray(values, np.float64)))
