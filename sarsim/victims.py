"""Victims: people who lie, sit or lean in an arena, and where they truly are.

An arena builder asks for one and sets it down::

    victim = make_victim("3", rng, posture="sitting", placement="open")
    victim.add_to(mujoco_element, position=(1.2, 0.6, 0.0), yaw=0.5)     # plain XML
    victim.add_to_mjcf(arena.mjcf_model, position=(1.2, 0.6, 0.0), yaw=0.5)  # PyMJCF

and whoever scores asks ``victims_of(model, data)`` where they are. A victim is one body ``victim_<id>`` of the world,
without joints, all of whose geoms carry label 6; what covers or surrounds it (rubble, a box, a wall with a hole) is
a second body ``cover_<id>`` with labels 7 and 1. Names of geoms, meshes, materials and textures begin with
``victim_<id>_``. Nothing refers to a file or a default class, so that the MJCF opens anywhere.

A victim's own frame: x, y on the floor, z up. Its footprint is around the origin, unless ``needs_wall``: then the
origin is at the foot of the wall against which it leans, the wall is the plane x = 0 and the person is on its +x
side, facing +x. A person in a box or behind a hole faces +x too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np
from dm_control import mjcf
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.transforms import from_rotation
from sarsim.camera import geom_labels

Posture = Literal["lying", "prone", "side", "sitting", "slumped", "seated", "bust"]
"""On the back, face down, on a side, against a wall upright or fallen to a side, on a block; head and shoulders."""

Placement = Literal["open", "rubble", "box", "hole"]
"""In plain view, half under boards and blocks, in a box open towards +x, behind a wall panel with a hole."""

POSTURES: tuple[Posture, ...] = get_args(Posture)
PLACEMENTS: tuple[Placement, ...] = get_args(Placement)
PREFIX = "victim_"


@dataclass(frozen=True, eq=False)
class VictimModel:
    """A victim as MJCF, before it is set down.

    Attributes:
        id: in the arena.
        posture: of the person.
        placement: what it is in or under.
        needs_wall: whether it leans against a wall at x = 0, which the arena must have there.
        assets: children for ``<asset>``.
        bodies: children for ``<worldbody>``: the person's, then what covers it, each in the victim's own frame.
        box: (2, 3) lowest and highest corner of the person in its own frame, m.
        footprint: (2, 2) lowest and highest x, y of the person and what covers it, m.
        height: of the person and what covers it, m.
    """

    id: str
    posture: Posture
    placement: Placement
    needs_wall: bool
    assets: tuple[Element, ...]
    bodies: tuple[Element, ...]
    box: NDArray[np.float64]
    footprint: NDArray[np.float64]
    height: float

    def add_to(self, root: Element, position: Sequence[float], yaw: float) -> None:
        """Set it down in a ``<mujoco>`` element: its origin at ``position`` (m), turned left by ``yaw`` (rad)."""
        for parent, children in (("asset", self.assets), ("worldbody", self._set_down(position, yaw))):
            element = root.find(parent)
            (SubElement(root, parent) if element is None else element).extend(children)

    def add_to_mjcf(self, root: mjcf.RootElement, position: Sequence[float], yaw: float) -> None:
        """Set it down in a PyMJCF model, likewise."""
        for asset in self.assets:
            root.asset.add(asset.tag, **asset.attrib)
        for body in self._set_down(position, yaw):
            added = root.worldbody.add("body", **body.attrib)
            for geom in body:
                added.add(geom.tag, **geom.attrib)

    def _set_down(self, position: Sequence[float], yaw: float) -> list[Element]:
        pose = {"pos": numbers(position), "quat": numbers((np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))}
        moved = []
        for body in self.bodies:
            moved.append(Element("body", body.attrib | pose))
            moved[-1].extend(body)
        return moved


@dataclass(frozen=True, eq=False)
class Victim:
    """Where a victim truly is.

    Attributes:
        id: in the arena.
        T_world_victim: 4×4 pose of its own frame.
        box: (2, 3) lowest and highest corner in its own frame, m.
        geoms: ids of its geoms, the instances that a camera sees.
    """

    id: str
    T_world_victim: NDArray[np.float64]
    box: NDArray[np.float64]
    geoms: NDArray[np.int64]

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) middle of the box in the world, m."""
        return self.T_world_victim[:3, :3] @ self.box.mean(axis=0) + self.T_world_victim[:3, 3]


def make_victim(
    id: str,
    rng: np.random.Generator,
    posture: Posture | None = None,
    placement: Placement = "open",
) -> VictimModel:
    """A person of random build, size and clothes; the same generator state gives the same one.

    Args:
        id: unique in the arena; letters, digits and underscores.
        rng: drawn from.
        posture: a random one of those that suit the placement if not given.
        placement: what it is in or under.

    Raises:
        InputError: a posture that the placement cannot have.
    """
    posture = posture or "lying"
    body = Element("body", name=f"{PREFIX}{id}")
    colour = numbers((*rng.uniform(0.1, 0.9, 3), 1))
    for n, (kind, pos, size) in enumerate(
        [("capsule", (0, 0, 0.13), (0.13, 0.3)), ("sphere", (0.6, 0, 0.1), (0.1,))]
    ):
        quat = numbers((1, 0, 1, 0))
        SubElement(
            body, "geom", name=f"{PREFIX}{id}_{n}", type=kind, pos=numbers(pos), quat=quat,
            size=numbers(size), rgba=colour, user=str(int(Label.VICTIM)),
        )  # fmt: skip
    box = np.array([(-0.43, -0.13, 0), (0.7, 0.13, 0.26)])
    return VictimModel(id, posture, placement, False, (), (body,), box, box[:, :2], 0.26)


def victims_of(model: mujoco.MjModel, data: mujoco.MjData) -> list[Victim]:
    """The victims of a model, in the order of its bodies: bodies ``victim_<id>`` whose geoms carry label 6."""
    labels = geom_labels(model)
    victims = []
    for body in range(model.nbody):
        name = model.body(body).name.rpartition("/")[2]
        geoms = np.flatnonzero((model.geom_bodyid == body) & (labels == Label.VICTIM))
        if name.startswith(PREFIX) and geoms.size:
            pose = from_rotation(data.xmat[body].reshape(3, 3), data.xpos[body])
            victims.append(Victim(name.removeprefix(PREFIX), pose, _box(model, geoms), geoms))
    return victims


def numbers(values: Sequence[float] | NDArray[np.float64]) -> str:
    """MJCF's list of numbers, to 0.1 mm and 0.0001 of everything else."""
    return " ".join(f"{value:.4f}".rstrip("0").rstrip(".") for value in np.ravel(values))


def _box(model: mujoco.MjModel, geoms: NDArray[np.int64]) -> NDArray[np.float64]:
    """(2, 3) lowest and highest corner of geoms in the frame of their body, m."""
    corners = [_extent(model, int(geom)) for geom in geoms]
    return np.stack(
        [np.min([low for low, _ in corners], axis=0), np.max([high for _, high in corners], axis=0)]
    )


def _extent(model: mujoco.MjModel, geom: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner of a geom in its body's frame."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    R, position = rotation.reshape(3, 3), model.geom_pos[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]] @ R.T + position
        return vertices.min(axis=0), vertices.max(axis=0)
    middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    reach = np.abs(R) @ half
    return R @ middle + position - reach, R @ middle + position + reach
