"""The victims of an SDF world: models that are marked as victims by their names or by the names of their folders.

A victim with shapes becomes a body with these shapes, all labelled as victim. A victim without shapes is replaced by
a person of the library, who lies at the same position.
"""

import logging
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from sarsim.arenas.elements import ArenaBuilder, Attributes
from sarsim.arenas.placements import WorldPose, add_person, is_victim, state_of
from sarsim.arenas.sdf.pieces import with_volume
from sarsim.arenas.sdf.solids import Solid, SolidReader
from sarsim.arenas.sdf.world import SdfModel, SdfWorld
from sarsim.vetting.model_files import MAX_GEOMS

_log = logging.getLogger(__name__)


def victims_of(world: SdfWorld) -> list[SdfModel]:
    """The models of a world that are victims and not nested in other victims."""
    victims = list[SdfModel]()
    for model in world.models():
        is_inside = any(model.scoped_name.startswith(f"{victim.scoped_name}::") for victim in victims)
        if not is_inside and not model.is_empty and is_victim(_name_with_folder(model)):
            victims.append(model)
    return victims


def _name_with_folder(model: SdfModel) -> str:
    """The name of a model in its world, preceded by the name of the folder from which it is included."""
    return f"{model.uri.rstrip('/').rpartition('/')[2]} {model.name}"


def add_victims(builder: ArenaBuilder, path: Path, world: SdfWorld, victims: list[SdfModel]) -> None:
    """Add the victims of the world in the file ``path``.

    Raises:
        InputError: a victim has too many shapes.
    """
    unseen = list[SdfModel]()
    for victim, solids in zip(victims, _solids_of(world, victims), strict=True):
        if len(solids) > MAX_GEOMS:
            raise InputError(f"{path}: {victim.name} has {len(solids)} shapes; the limit is {MAX_GEOMS}")
        if solids:
            origin = victim.T_world[:3, 3]
            geoms = [(_geom(builder, solid, origin), solid.colour) for solid in solids]
            builder.add_victim(origin, geoms, state_of(_name_with_folder(victim)))
        else:
            unseen.append(victim)
            add_person(builder, _pose(victim))
    if unseen:
        names = ", ".join(victim.name for victim in unseen)
        _log.warning("%s: replaced each victim without a readable shape with a person lying down: %s", path, names)


def _solids_of(world: SdfWorld, victims: list[SdfModel]) -> list[list[Solid]]:
    """The solids of each victim, without planes, from one pass over the world."""
    reader, missing = SolidReader(world.meshes), {victim.scoped_name for victim in victims if victim.is_missing}
    found: dict[str, list[Solid]] = {victim.scoped_name: [] for victim in victims}
    for shape in (
        world.shapes(without=lambda model: model.scoped_name in missing) if len(missing) < len(victims) else ()
    ):
        of = next((name for name in found if f"{shape.model}::".startswith(f"{name}::")), None)
        if of is not None:
            with world.skipping_errors():
                found[of] += (solid for solid in reader.solids(shape) if solid.kind != "plane")
    return list(found.values())


def _pose(victim: SdfModel) -> WorldPose:
    """Position and heading of a victim.

    The heading is the direction of the model's x axis. A rotation about x, which puts a mesh with y up upright,
    therefore does not change the heading.
    """
    T = victim.T_world
    x, y, z = T[:3, 3].tolist()
    return WorldPose(_name_with_folder(victim), x, y, z, float(np.arctan2(T[1, 0], T[0, 0])))


def _geom(builder: ArenaBuilder, solid: Solid, origin: np.ndarray) -> Attributes:
    """The MJCF attributes of a solid's geom in a body at ``origin`` (3,) m that is not rotated."""
    pose, piece = solid.mjcf_attributes | {"pos": solid.T_world[:3, 3] - origin}, solid.piece
    if piece is None:
        return pose | {"size": solid.size}
    if (plate := with_volume(piece.vertices)) is not piece.vertices:
        return pose | {"mesh": builder.add_mesh(piece.vertices if plate is None else plate)}
    return pose | {"mesh": builder.add_mesh(piece.vertices, piece.triangles if len(piece.triangles) else None)}
