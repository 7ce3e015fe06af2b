"""Victims: people who lie, sit or lean in an arena, and their true poses.

An arena builder makes a victim with ``make_victim("3", rng, "sitting", "open")``, and places it with
``victim.add_to(mujoco_element, position=(1.2, 0.6, 0.0), yaw=0.5)``; scoring locates victims with
``victims_of(model, data)``. A victim is a body ``victim_<id>`` of the world, without joints; all geoms of this body
have label 6. The names of the victim's geoms, meshes, materials and textures start with ``victim_<id>_``. A cover
(rubble, a box, a wall with a hole) is a second body, ``cover_<id>``, with labels 7 and 1. The MJCF refers to no file
and no default class, so that it can be opened anywhere.

A victim's own frame has x and y on the floor and z up. The footprint surrounds the origin unless ``needs_wall`` is
set. In that case, the origin is at the foot of the wall against which the victim leans, the wall is the plane x = 0,
and the person is on its +x side, facing +x. A person in a box or behind a hole also faces +x.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Box, Indices, Place, Pose
from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.transforms import from_rotation, transform_places
from sarsim.ground_truth.shapes import mesh_vertices, rotation
from sarsim.sensors.camera import geom_labels
from sarsim.victims.body import UPPER_BODY, Outfit, person_mjcf
from sarsim.victims.cover import PersonCover, box, joined, rubble, seat, wall_with_hole
from sarsim.victims.mjcf import numbers
from sarsim.victims.people import AGAINST_WALL, CHIN, Figure, people

Posture = Literal["lying", "prone", "side", "sitting", "slumped", "seated", "bust"]
"""The posture of a victim:

- ``lying``, ``prone`` and ``side``: on the back, face down and on one side,
- ``sitting`` and ``slumped``: upright and slumped against a wall,
- ``seated``: on a block,
- ``bust``: only head and shoulders.
"""

Placement = Literal["open", "rubble", "box", "hole"]
"""The placement of a victim:

- ``open``: in plain view,
- ``rubble``: half under boards and blocks,
- ``box``: in a box that is open towards +x,
- ``hole``: behind a wall panel with a hole.
"""

POSTURES: tuple[Posture, ...] = get_args(Posture)
PLACEMENTS: tuple[Placement, ...] = get_args(Placement)
VICTIM_PREFIX, COVER_PREFIX = "victim_", "cover_"  # Prefixes of the names of the two bodies
SUITABLE_POSTURES: dict[Placement, tuple[Posture, ...]] = {
    "open": POSTURES,
    "rubble": ("lying", "prone", "side"),
    "box": ("bust", "sitting"),
    "hole": ("side", "sitting", "seated"),
}
"""The postures possible in each placement; a random posture is always one that needs no wall."""
STATURE_RANGES = {"man": (1.65, 1.88), "woman": (1.55, 1.75), "stout": (1.62, 1.82), "child": (1.0, 1.4)}
"""Range of statures of each build, m."""


@dataclass(frozen=True, eq=False)
class VictimModel:
    """A victim, before it is placed in an arena's MJCF.

    Attributes:
        id: unique name in the arena.
        posture: posture of the person.
        placement: the kind of cover.
        needs_wall: whether the person leans against a wall at x = 0, which the arena must provide.
        figure: the person.
        outfit: the appearance of the person.
        cover: objects that the person is in, under, behind or on.
        box: lowest and highest corner of the person in the victim's own frame, m.
        footprint: (2, 2) m, lowest and highest x, y of the person and the cover.
        height: height of the person and the cover, m.
    """

    id: str
    posture: Posture
    placement: Placement
    needs_wall: bool
    figure: Figure
    outfit: Outfit
    cover: PersonCover
    box: Box
    footprint: NDArray[np.float64]
    height: float

    def add_to(self, root: Element, position: Sequence[float], yaw: float) -> None:
        """Add the victim to a ``<mujoco>`` element, with origin ``position`` (3,) m, turned left by ``yaw`` rad."""
        pose = {"pos": numbers(position), "quat": numbers((np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))}
        # Made only here, because most people generated for an arena fit in no free place and are never added.
        assets, person = person_mjcf(VICTIM_PREFIX + self.id, self.figure, self.outfit)
        bodies = []
        for body, geoms in ((VICTIM_PREFIX + self.id, person), (COVER_PREFIX + self.id, self.cover.geoms)):
            if geoms:
                bodies.append(Element("body", {"name": body} | pose))
                bodies[-1].extend(geoms)
        for parent, children in (("asset", assets), ("worldbody", bodies)):
            element = root.find(parent)
            (SubElement(root, parent) if element is None else element).extend(children)


@dataclass(frozen=True, eq=False)
class TrueVictim:
    """The true pose and extent of a victim.

    Attributes:
        id: unique name in the arena.
        T_world_victim: pose of the victim's own frame.
        box: lowest and highest corner in the victim's own frame, m.
        geoms: ids of the victim's geoms, as in a camera's instance image.
    """

    id: str
    T_world_victim: Pose
    box: Box
    geoms: Indices

    @property
    def centre(self) -> Place:
        """Centre of the box in the world, m."""
        return transform_places(self.T_world_victim, self.box.mean(axis=0))


def make_victim(
    id: str,
    rng: np.random.Generator,
    posture: Posture | None = None,
    placement: Placement = "open",
    stature: float | None = None,
    room: tuple[float, float] = (np.inf, np.inf),
) -> VictimModel:
    """Make a victim of random build, size and clothes; the same generator state gives the same victim.

    Args:
        id: unique name in the arena, made of letters, digits and underscores.
        rng: random generator.
        posture: posture of the person; by default, a random posture that needs no wall.
        placement: the kind of cover.
        stature: standing height of the person, m; by default, a random height that suits the build.
        room: maximum size of the person along x and y, m.

    Raises:
        InputError: the placement does not allow the posture, or no person in that posture fits into ``room``.
    """
    choice = [p for p in SUITABLE_POSTURES[placement] if posture in (p, None) and (posture or p not in AGAINST_WALL)]
    if not choice:
        raise InputError(
            f"victim {id}: posture {posture!r} cannot be used in placement {placement!r}; choose from"
            f" {', '.join(SUITABLE_POSTURES[placement])}"
        )
    posture = choice[rng.integers(len(choice))]
    figures = _figures(posture, placement, stature, rng)
    fitting = ((f, b) for f, b in figures if np.all(np.ptp(f.visible_vertices("bald"), axis=0)[:2] <= room))
    figure, build = next(fitting, (None, ""))
    if figure is None:
        raise InputError(f"victim {id}: no {posture} person fits into {room[0]:g} × {room[1]:g} m")
    outfit = Outfit.random(build, rng)
    person = figure.visible_vertices(outfit.hair_style)
    cover = _cover(COVER_PREFIX + id, posture, placement, figure, person, rng)
    everything = np.concatenate([person, cover.points])
    return VictimModel(
        id, posture, placement, posture in AGAINST_WALL and placement != "box", figure, outfit, cover,
        box=_extremes(person), footprint=_extremes(everything)[:, :2], height=float(everything[:, 2].max()),
    )  # fmt: skip


def victims_of(model: mujoco.MjModel, data: mujoco.MjData) -> list[TrueVictim]:
    """The victims of a model in the order of its bodies: bodies ``victim_<id>`` that have geoms with label 6."""
    labels = geom_labels(model)
    victims = []
    for body in range(model.nbody):
        name = model.body(body).name.rpartition("/")[2]
        geoms = np.flatnonzero((model.geom_bodyid == body) & (labels == Label.VICTIM))
        if name.startswith(VICTIM_PREFIX) and geoms.size:
            pose = from_rotation(data.xmat[body].reshape(3, 3), data.xpos[body])
            victims.append(TrueVictim(name.removeprefix(VICTIM_PREFIX), pose, box_of_geoms(model, geoms), geoms))
    return victims


def box_of_geoms(model: mujoco.MjModel, geoms: Indices) -> Box:
    """Lowest and highest corner of some geoms of a body, in the body's frame, m."""
    return _extremes(np.concatenate([_extent(model, int(geom)) for geom in geoms]))


def _figures(
    posture: Posture, placement: Placement, stature: float | None, rng: np.random.Generator
) -> Iterator[tuple[Figure, str]]:
    """Yield the library's people in a posture, and their builds, in random order; the default stature is random."""
    library = people()
    kept = "sitting" if posture == "bust" else posture  # a bust is the upper part of a person who sits upright
    for pose in rng.permutation(np.flatnonzero(library.postures == kept)):
        build = str(library.builds[pose])
        figure = library.figure(int(pose), stature or rng.uniform(*STATURE_RANGES[build]))
        if posture == "bust":
            figure = figure.only(UPPER_BODY).centred()
        elif placement == "hole" and posture not in AGAINST_WALL:
            forward = figure.head_rotation @ [0, 0, 1]
            figure = figure.moved(-np.arctan2(forward[1], forward[0]), np.zeros(3)).centred()
        yield figure, build


def _cover(
    name: str,
    posture: Posture,
    placement: Placement,
    figure: Figure,
    person: NDArray[np.float64],
    rng: np.random.Generator,
) -> PersonCover:
    """The objects that the person is in, under, behind or on."""
    covers = [seat(name, people().seat_half_sizes * figure.scale)] if posture == "seated" else []
    if placement == "rubble":
        covers.append(rubble(name, person, rng))
    elif placement == "box":
        covers.append(box(name, person))
    elif placement == "hole":
        covers.append(wall_with_hole(name, person, figure.on_head(CHIN)[0]))
    return joined(covers)


def _extremes(places: NDArray[np.float64]) -> Box:
    """(2, 3) m, lowest and highest corner of points (N, 3) m."""
    return np.stack([places.min(axis=0), places.max(axis=0)])


def _extent(model: mujoco.MjModel, geom: int) -> Box:
    """Lowest and highest corner of a geom's bounding box in its body's frame, m."""
    R, position = rotation(model.geom_quat[geom]), model.geom_pos[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        return _extremes(mesh_vertices(model, geom) @ R.T + position)
    middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    reach = np.abs(R) @ half
    return np.stack([R @ middle + position - reach, R @ middle + position + reach])
