"""Objects to find as MJCF: signs, codes, tags, fire extinguishers and door levers.

For a viewer, the frame of a flat object or a lever has x to the right, y up and z towards the viewer. The origin is
at the centre of a flat object's front, and on the wall for a lever. The frame of a fire extinguisher has its origin
at the centre of the foot, and z up.
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from xml.etree.ElementTree import Element, SubElement

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Rotation3
from pipeline.labels import Label
from sarsim.arenas.things.codes import QUIET_ZONE, TAG_MODULES, qr_picture, tag_picture
from sarsim.arenas.things.hazmat import SignStyle, sign_png
from sarsim.arenas.things.thing import annotate_body
from sarsim.victims.mjcf import geom, numbers, quaternion

BACKING_PREFIX = "backing_"  # Prefix of the name of the body with an object's backing, such as paper or a blanket
PAPER_THICKNESS = 0.001  # m, thickness of paper; a depth camera cannot resolve it
PAPER, METAL, RUBBER = (0.93, 0.93, 0.91), (0.62, 0.63, 0.65), (0.06, 0.06, 0.06)
BOTTLE_COLOURS = ((0.75, 0.05, 0.04), (0.82, 0.10, 0.07), (0.62, 0.03, 0.05))  # Colours of fire extinguishers
LABEL_COLOURS = ((0.92, 0.92, 0.90), (0.93, 0.83, 0.15), (0.85, 0.85, 0.80))
ALONG_X = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
"""Quaternion that aligns a capsule or cylinder with x."""
ALONG_Y = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
"""Quaternion that aligns a capsule or cylinder with y."""


@dataclass(frozen=True, eq=False)
class ThingModel:
    """An object to find, before it is added to an arena.

    Attributes:
        name: name of its body, unique in the arena.
        kind: one of :data:`pipeline.tracks.find.KINDS`, except heat.
        text: class of a sign, text of a QR code, or number of a tag.
        state: alive or dead, for a victim.
        geoms: geoms of its body.
        assets: materials and textures.
        files: contents of the pictures to which the textures refer, by name.
        backing: geoms that come with the object but are not part of it, such as paper or a blanket.
    """

    name: str
    kind: str
    text: str
    geoms: list[Element]
    assets: list[Element] = field(default_factory=list)
    files: dict[str, bytes] = field(default_factory=dict)
    state: str = ""
    backing: list[Element] = field(default_factory=list)

    def add_to(self, root: Element, position: ArrayLike, R: Rotation3) -> None:
        """Add the object to a ``<mujoco>`` element, with origin ``position`` (3,) m and orientation ``R`` (3, 3)."""
        annotate_body(root, self.name, self.kind, self.text, self.state)
        pose = {"pos": numbers(np.asarray(position), 6), "quat": numbers(quaternion(R), 6)}
        bodies = []
        for name, geoms in ((self.name, self.geoms), (BACKING_PREFIX + self.name, self.backing)):
            if geoms:
                bodies.append(Element("body", {"name": name} | pose))
                bodies[-1].extend(geoms)
        for parent, children in (("asset", self.assets), ("worldbody", bodies)):
            element = root.find(parent)
            (SubElement(root, parent) if element is None else element).extend(children)


@dataclass(frozen=True, eq=False)
class ColouredGeom:
    """A geom in a plain colour.

    Attributes:
        name: name of the geom, which is appended to the body's name.
        shape: type of the geom, as in MJCF.
        position: (3,) m, position of its centre.
        size: sizes as in MJCF, m.
        colour: red, green, blue, from 0 to 1.
        quat: (4,) orientation, as a quaternion (w, x, y, z).
    """

    name: str
    shape: str
    position: ArrayLike
    size: ArrayLike
    colour: tuple[float, ...]
    quat: ArrayLike = (1.0, 0.0, 0.0, 0.0)

    def moved(self, R: Rotation3, shift: NDArray[np.float64]) -> "ColouredGeom":
        """The geom rotated by ``R`` (3, 3) about the origin, then shifted by ``shift`` (3,) m."""
        quat = np.empty(4)
        mujoco.mju_mulQuat(quat, quaternion(R), np.asarray(self.quat, np.float64))
        return replace(self, position=R @ np.asarray(self.position, np.float64) + shift, quat=quat)

    def geom(self, body: str, label: Label = Label.CLUTTER) -> Element:
        """The geom as MJCF, for the body named ``body``."""
        pose = {"pos": numbers(np.asarray(self.position), 5), "quat": numbers(np.asarray(self.quat), 6)}
        look = {"size": numbers(np.asarray(self.size), 5), "rgba": numbers((*self.colour, 1))}
        return geom(f"{body}_{self.name}", label, type=self.shape, **pose, **look)


def hazmat_sign(name: str, kind: str, side: float, style: SignStyle, paper: float = 0.0) -> ThingModel:
    """A sign of class ``kind`` with sides of ``side`` m, on its corner, on paper with a margin of ``paper`` m."""
    turned = numbers((np.cos(np.pi / 8), 0, 0, -np.sin(np.pi / 8)), 6)  # puts the picture's top left corner on top
    content = sign_png(kind, style)
    plate, assets, files = _printed(name, content, side / 2, turned)
    sheet = [_sheet(f"{name}_paper", (side / 2 + paper,) * 2, PAPER, turned)] if paper else []
    return ThingModel(name, "hazmat_sign", kind, [plate], assets, files, backing=sheet)


def qr_code(name: str, text: str, side: float) -> ThingModel:
    """A QR code whose sides measure ``side`` m without the quiet zone."""
    code = qr_picture(text)
    modules = len(code) // 8
    plate, assets, files = _printed(name, _png(code), side / 2 * modules / (modules - 2 * QUIET_ZONE))
    return ThingModel(name, "qr_code", text, [plate], assets, files)


def april_tag(name: str, number: int, side: float) -> ThingModel:
    """An AprilTag of family 36h11 whose black square measures ``side`` m."""
    plate, assets, files = _printed(name, _png(tag_picture(number)), side / 2 * (TAG_MODULES + 2) / TAG_MODULES)
    return ThingModel(name, "april_tag", str(number), [plate], assets, files)


def door_lever(name: str, length: float, to_left: bool) -> ThingModel:
    """A door lever of ``length`` m on a plate with a keyhole; ``to_left``: whether the lever points to the left."""
    way = -1 if to_left else 1
    parts = [
        ColouredGeom("plate", "box", (0, -0.03, 0.004), (0.022, 0.11, 0.004), METAL),
        ColouredGeom("rose", "cylinder", (0, 0.03, 0.012), (0.02, 0.006), METAL),
        ColouredGeom("neck", "cylinder", (0, 0.03, 0.032), (0.009, 0.02), METAL),
        ColouredGeom("lever", "capsule", (way * length / 2, 0.03, 0.052), (0.0095, length / 2), METAL, ALONG_X),
        ColouredGeom("lock", "cylinder", (0, -0.05, 0.009), (0.011, 0.002), METAL),
        ColouredGeom("keyhole", "box", (0, -0.05, 0.0115), (0.0015, 0.006, 0.0005), RUBBER),
    ]
    return ThingModel(name, "door_lever", "", [part.geom(name) for part in parts])


def fire_extinguisher(name: str, radius: float, height: float, paint: int, label: int) -> ThingModel:
    """A fire extinguisher: a red bottle with a label, a valve, a handle, a gauge and a hose.

    ``radius`` and ``height`` are in m; ``paint`` and ``label`` are indices of the bottle's and the label's colours.
    """
    red, r, h, top = BOTTLE_COLOURS[paint % len(BOTTLE_COLOURS)], radius, 0.72 * height, height
    parts = [
        ColouredGeom("foot", "cylinder", (0, 0, 0.01), (r * 1.02, 0.01), RUBBER),
        ColouredGeom("bottle", "cylinder", (0, 0, h / 2 + 0.01), (r, h / 2 - 0.01), red),
        ColouredGeom("shoulder", "ellipsoid", (0, 0, h), (r, r, 0.6 * r), red),
        ColouredGeom(
            "label", "cylinder", (0, 0, 0.5 * h), (r + 0.0015, 0.17 * h), LABEL_COLOURS[label % len(LABEL_COLOURS)]
        ),
        ColouredGeom("print", "cylinder", (0, 0, 0.56 * h), (r + 0.0020, 0.03 * h), red),
        ColouredGeom("neck", "cylinder", (0, 0, h + 0.6 * r + 0.02), (0.018, 0.03), METAL),
        ColouredGeom("valve", "box", (0, 0, top - 0.045), (0.022, 0.018, 0.016), RUBBER),
        ColouredGeom("gauge", "cylinder", (0, -0.022, top - 0.045), (0.012, 0.004), PAPER, ALONG_Y),
        ColouredGeom("grip", "box", (0.045, 0, top - 0.035), (0.045, 0.011, 0.004), RUBBER),
        ColouredGeom("trigger", "box", (0.04, 0, top - 0.01), (0.05, 0.011, 0.004), red),
    ]
    return ThingModel(name, "fire_extinguisher", "", [part.geom(name) for part in parts + _hose(r, h, top)])


def _hose(radius: float, shoulder: float, top: float) -> list[ColouredGeom]:
    """A hose that bends from the valve to the side of the bottle, where it ends in a nozzle."""
    side = radius + 0.016
    places = np.array([(-0.02, top - 0.045), (-0.6 * side, top - 0.04), (-side, top - 0.1), (-side, 0.4 * shoulder)])
    hose = []
    for n, (start, end) in enumerate(pairwise(places)):
        middle, half = (start + end) / 2, (end - start) / 2
        tilt, size = np.arctan2(half[0], half[1]) / 2, (0.01, float(np.linalg.norm(half)))
        quat = (np.cos(tilt), 0, np.sin(tilt), 0)
        hose.append(ColouredGeom(f"hose_{n}", "capsule", (middle[0], 0, middle[1]), size, RUBBER, quat))
    return [*hose, ColouredGeom("nozzle", "cylinder", (-side, 0, 0.34 * shoulder), (0.014, 0.08 * shoulder), RUBBER)]


def _sheet(name: str, half: tuple[float, float], colour: tuple[float, float, float], quat: str) -> Element:
    """A sheet directly behind an object that hangs on the wall; ``half``: half sizes, m."""
    size = numbers((*half, PAPER_THICKNESS / 4), 6)
    pose = {
        "pos": numbers((0, 0, -3 * PAPER_THICKNESS / 4), 6),
        "quat": quat,
        "size": size,
        "rgba": numbers((*colour, 1)),
    }
    return geom(name, Label.CLUTTER, type="box", contype="0", conaffinity="0", **pose)


def _printed(
    name: str, content: bytes, half: float, quat: str = "1 0 0 0"
) -> tuple[Element, list[Element], dict[str, bytes]]:
    """A square plate, 2 ``half`` m wide, with a picture on its front at z = 0, and the plate's assets and file."""
    file = f"{name}.png"
    texture = Element("texture", name=name, type="2d", file=file)
    material = Element("material", name=name, texture=name, texuniform="false", specular="0.02", shininess="0.05")
    plate = geom(
        f"{name}_plate", Label.CLUTTER, type="box", size=numbers((half, half, PAPER_THICKNESS / 4), 6),
        pos=numbers((0, 0, -PAPER_THICKNESS / 4), 6), quat=quat, material=name, contype="0", conaffinity="0",
    )  # fmt: skip
    return plate, [texture, material], {file: content}


def _png(picture: NDArray[np.uint8]) -> bytes:
    """A grey picture (H, W) as the content of a colour PNG file."""
    return cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))[1].tobytes()
