"""The objects to find in a model: bodies with a kind, a text and a state.

The MJCF gives these properties in ``<custom>``, as ``<text name="BODY" data="kind=hazmat_sign;text=poison;state="/>``
with URL-encoded values. A victim without such an element is alive.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import quote, unquote
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np

from pipeline.arrays import Box, Direction, Indices, Place, Pose
from pipeline.tracks.find import HEAT, KINDS, VICTIM
from pipeline.transforms import from_rotation, transform_places
from sarsim.victims.victims import VICTIM_PREFIX, box_of_geoms, victims_of

ALIVE, DEAD = "alive", "dead"
MAX_TEXT = 4000  # Maximum number of bytes of a text that are read; the largest QR code holds 2,953 bytes


@dataclass(frozen=True, eq=False)
class Thing:
    """An object to find.

    Attributes:
        name: name of its body.
        kind: one of ``KINDS``, except heat.
        text: class of a sign, text of a QR code, or number of a tag; otherwise empty.
        state: alive or dead for a victim; otherwise empty.
        T_world_thing: pose of its frame. Signs, codes and tags have their origin at the centre of the front, x to the
            right, y up (for a sign, towards the top of its print) and z towards the viewer. Levers have the same
            axes. Other objects have z up.
        box: lowest and highest corner in its own frame, m.
        geoms: ids of its geoms, which are also the instance ids in camera images.
    """

    name: str
    kind: str
    text: str
    state: str
    T_world_thing: Pose
    box: Box
    geoms: Indices

    @property
    def centre(self) -> Place:
        """Centre of the box in the world, m."""
        return transform_places(self.T_world_thing, self.box.mean(axis=0))

    @property
    def normal(self) -> Direction:
        """Direction of the z axis in the world; for flat objects, it points towards the viewer."""
        return self.T_world_thing[:3, 2]

    @property
    def is_warm(self) -> bool:
        """Whether the object is a living victim."""
        return self.kind == VICTIM and self.state == ALIVE


def things_of(model: mujoco.MjModel, data: mujoco.MjData) -> list[Thing]:
    """The objects to find in a model: first the victims, then the others, both in the order of their bodies."""
    stated = dict(_annotations(model))
    victims = [
        Thing(
            VICTIM_PREFIX + v.id,
            VICTIM,
            *stated.get(VICTIM_PREFIX + v.id, ("", "", ALIVE))[1:],
            v.T_world_victim,
            v.box,
            v.geoms,
        )
        for v in victims_of(model, data)
    ]
    return victims + list(_others(model, data, stated))


def things_of_kind(things: Sequence[Thing], kind: str) -> list[Thing]:
    """The objects of a kind; for the kind heat, the warm objects."""
    return [thing for thing in things if (thing.is_warm if kind == HEAT else thing.kind == kind)]


def annotate_body(root: Element, name: str, kind: str, text: str = "", state: str = "") -> None:
    """Add the kind, text and state of the body ``name`` to a ``<mujoco>`` element."""
    custom = root.find("custom")
    custom = SubElement(root, "custom") if custom is None else custom
    SubElement(custom, "text", name=name, data=data_of(kind, text, state))


def data_of(kind: str, text: str = "", state: str = "") -> str:
    """The ``data`` attribute of a custom text with the kind, text and state of a body."""
    return ";".join(f"{key}={quote(value)}" for key, value in (("kind", kind), ("text", text), ("state", state)))


def _others(model: mujoco.MjModel, data: mujoco.MjData, stated: dict[str, tuple[str, str, str]]) -> Iterator[Thing]:
    for body in range(model.nbody):
        name = model.body(body).name.rpartition("/")[2]
        kind, text, state = stated.get(name, ("", "", ""))
        geoms = np.flatnonzero(model.geom_bodyid == body)
        if kind in KINDS[1:-1] and geoms.size:
            T = from_rotation(data.xmat[body].reshape(3, 3), data.xpos[body])
            yield Thing(name, kind, text, state, T, box_of_geoms(model, geoms), geoms)


def _annotations(model: mujoco.MjModel) -> Iterator[tuple[str, tuple[str, str, str]]]:
    """Yield the name, kind, text and state of each body for which a custom text gives the kind."""
    for n in range(model.ntext):
        start = int(model.text_adr[n])
        raw = bytes(model.text_data[start : start + min(int(model.text_size[n]) - 1, MAX_TEXT)])
        values = dict(part.partition("=")[::2] for part in raw.decode(errors="replace").split(";"))
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, n) or ""
        if "kind" in values:
            kind, text, state = (unquote(values.get(key, "")) for key in ("kind", "text", "state"))
            yield name.rpartition("/")[2], (kind, text, state)
