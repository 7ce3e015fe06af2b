"""The things to find that elements of the library stand for: ``.raf`` files and furnished arenas name them.

What the format does not say is fixed here: of the letters of a victim's type, t (thermal) and the word heat mean that
the doll is warm, q and qr that a code is in its box; a doll without any such sign is warm. The class of a plain
``hazmat``, or of an unknown class, is the next of all classes.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.finds.hazmat_classes import HAZMAT_CLASSES
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.things.dolls import doll
from sarsim.arenas.things.hazmat import SignStyle
from sarsim.arenas.things.models import ThingModel, fire_extinguisher, hazmat_sign, qr_code
from sarsim.arenas.things.thing import ALIVE, DEAD

OTHER_WORDS = {
    "explosives": "explosive",
    "blasting-agents": "explosive",
    "blasting_agents": "explosive",
    "fuel-oil": "flammable-liquid",
}
"""Names of classes of the arena designer, and what teams report."""
TOWARDS_VIEWER = np.array([(1.0, 0, 0), (0, 0, -1.0), (0, 1.0, 0)])
"""Axes of what hangs on an element's back wall, in its frame: x right, y up, z towards -y."""
SIGN_SIDE, SIGN_AT = 0.28, (0.0, 0.588, 0.2)  # m, of the arena designer's signs
WALL_CODE_SIDE, WALL_CODE_AT = 0.2, (0.0, 0.594, 0.6)  # m, of the codes of ``small_wall_qr``
BOX_CODE_SIDE, BOX_CODE_AT = 0.08, (-0.17, 0.579, 0.12)  # m, of the codes in boxes of dolls: in a corner of the back
BOTTLE = (0.07, 0.42)  # m, radius and height of an extinguisher
_Placed = tuple[ThingModel, NDArray[np.float64], NDArray[np.float64]]
"""A thing, and its position (3,) m and axes (3, 3) in the frame of its element."""


def add_things(builder: ArenaBuilder, kind: str, position: NDArray[np.float64], yaw_deg: float) -> None:
    """Add what an element of type ``kind``, its origin at ``position`` (3,) m, holds besides its plain geoms."""
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    R = np.array([(cos, -sin, 0), (sin, cos, 0), (0, 0, 1)])
    for thing, place, turn in _things(builder, kind):
        builder.add_thing(thing, position + R @ place, R @ turn)


def _things(
    builder: ArenaBuilder, kind: str
) -> Iterator[tuple[ThingModel, NDArray[np.float64], NDArray[np.float64]]]:
    """The things of an element."""
    number = builder.next_thing
    if kind.startswith("hazmat"):
        sign = hazmat_sign(f"hazmat_sign_{number}", _class(kind, number), SIGN_SIDE, SignStyle())
        yield sign, np.array(SIGN_AT), TOWARDS_VIEWER
    elif kind == "small_wall_qr":
        code = qr_code(f"qr_code_{number}", f"wall {number}", WALL_CODE_SIDE)
        yield code, np.array(WALL_CODE_AT), TOWARDS_VIEWER
    elif kind == "fire_extinguisher":
        yield fire_extinguisher(f"fire_extinguisher_{number}", *BOTTLE, number, number), np.zeros(3), np.eye(3)
    elif kind.startswith(("victim_with_box", "victim_doll")):
        yield from _boxed(builder, kind, number)


def _boxed(builder: ArenaBuilder, kind: str, number: int) -> Iterator[_Placed]:
    """The doll in a box, and the code beside it."""
    signs = kind.removeprefix("victim_with_box").removeprefix("victim_doll").removesuffix("with_box").strip("_1")
    is_warm = not signs or "t" in signs
    yield doll(builder.next_victim, ALIVE if is_warm else DEAD, np.random.default_rng(number)), np.zeros(3), np.eye(3)
    if signs in ("q", "qr"):
        yield qr_code(f"qr_code_{number}", f"victim {number}", BOX_CODE_SIDE), np.array(BOX_CODE_AT), TOWARDS_VIEWER


def _class(kind: str, number: int) -> str:
    """The class of a sign of type ``hazmat_CLASS``."""
    word = kind.removeprefix("hazmat").strip("_")
    return OTHER_WORDS.get(word, word if word in HAZMAT_CLASSES else HAZMAT_CLASSES[number % len(HAZMAT_CLASSES)])
