"""Objects to find that library elements represent in ``.raf`` files and furnished arenas.

The format of ``.raf`` files leaves some points open, for which sarsim has its own rules:

- The suffix of a victim's type states the contents of the victim's box. The letter t (thermal) or the word heat
  means a warm doll, and q or qr means a QR code. A doll without a suffix is warm.
- If a sign's type gives no class or an unknown one, the class is chosen from the list of all classes by the number of
  the sign.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.tracks.find import HAZMAT_CLASSES
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.things.dolls import doll
from sarsim.arenas.things.hazmat import SignStyle
from sarsim.arenas.things.models import ThingModel, fire_extinguisher, hazmat_sign, qr_code
from sarsim.arenas.things.thing import ALIVE, DEAD

CLASS_SYNONYMS = {
    "explosives": "explosive",
    "blasting-agents": "explosive",
    "blasting_agents": "explosive",
    "fuel-oil": "flammable-liquid",
}
"""Class names of the arena designer, with the names under which teams report these classes."""
TOWARDS_VIEWER = np.array([(1.0, 0, 0), (0, 0, -1.0), (0, 1.0, 0)])
"""Axes, as columns in an element's frame, of an object on the element's back wall: x right, y up, z along -y."""
# Side and position of objects in the element's frame, m.
SIGN_SIDE, SIGN_POSITION = 0.28, (0.0, 0.588, 0.2)  # Signs, as in the arena designer
WALL_CODE_SIDE, WALL_CODE_POSITION = 0.2, (0.0, 0.594, 0.6)  # Codes of ``small_wall_qr``
BOX_CODE_SIDE, BOX_CODE_POSITION = 0.08, (-0.17, 0.579, 0.12)  # Codes in a back corner of a doll's box
BOTTLE_SIZE = (0.07, 0.42)  # m, radius and height of a fire extinguisher
_Placed = tuple[ThingModel, NDArray[np.float64], NDArray[np.float64]]
"""An object to find, with the object's position (3,) m and axes (3, 3) in the frame of its element."""


def add_things(builder: ArenaBuilder, kind: str, position: NDArray[np.float64], yaw_deg: float) -> None:
    """Add the objects to find that an element of type ``kind`` represents.

    ``position``: (3,) m, origin of the element; ``yaw_deg``: rotation of the element to the left, degrees.
    """
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    R = np.array([(cos, -sin, 0), (sin, cos, 0), (0, 0, 1)])
    for thing, place, turn in _things(builder, kind):
        builder.add_thing(thing, position + R @ place, R @ turn)


def _things(
    builder: ArenaBuilder, kind: str
) -> Iterator[tuple[ThingModel, NDArray[np.float64], NDArray[np.float64]]]:
    """Yield each object to find that an element of type ``kind`` represents, in the form of ``_Placed``."""
    number = builder.next_thing_number
    if kind.startswith("hazmat"):
        sign = hazmat_sign(f"hazmat_sign_{number}", _hazmat_class(kind, number), SIGN_SIDE, SignStyle())
        yield sign, np.array(SIGN_POSITION), TOWARDS_VIEWER
    elif kind == "small_wall_qr":
        code = qr_code(f"qr_code_{number}", f"wall {number}", WALL_CODE_SIDE)
        yield code, np.array(WALL_CODE_POSITION), TOWARDS_VIEWER
    elif kind == "fire_extinguisher":
        yield fire_extinguisher(f"fire_extinguisher_{number}", *BOTTLE_SIZE, number, number), np.zeros(3), np.eye(3)
    elif kind.startswith(("victim_with_box", "victim_doll")):
        yield from _doll_in_box(builder, kind, number)


def _doll_in_box(builder: ArenaBuilder, kind: str, number: int) -> Iterator[_Placed]:
    """Yield the doll in a box and, if the element's type requests a code, the code next to the doll."""
    signs = kind.removeprefix("victim_with_box").removeprefix("victim_doll").removesuffix("with_box").strip("_1")
    is_warm = not signs or "t" in signs
    figure = doll(builder.next_victim_name, ALIVE if is_warm else DEAD, np.random.default_rng(number))
    yield figure, np.zeros(3), np.eye(3)
    if "q" in signs:
        code = qr_code(f"qr_code_{number}", f"victim {number}", BOX_CODE_SIDE)
        yield code, np.array(BOX_CODE_POSITION), TOWARDS_VIEWER


def _hazmat_class(kind: str, number: int) -> str:
    """The hazmat class of a sign whose element type is ``hazmat_CLASS``."""
    word = kind.removeprefix("hazmat").strip("_")
    return CLASS_SYNONYMS.get(word, word if word in HAZMAT_CLASSES else HAZMAT_CLASSES[number % len(HAZMAT_CLASSES)])
