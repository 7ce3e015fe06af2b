"""Loads an arena by its name."""

import logging
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from dm_control import mjcf

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.transforms import from_rotation, from_yaw
from sarsim.arenas.arena import RescueArena, prefixing_errors
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.map_2d import build_map
from sarsim.arenas.names import BUILT_EXTENSIONS, BUILT_IN, MJCF_EXTENSION, RANDOM, check_arena_name, seed_of
from sarsim.arenas.placements import add_person, read_placements
from sarsim.arenas.raf import build_raf
from sarsim.arenas.random_arena import build_random
from sarsim.arenas.sdf.build import build_sdf
from sarsim.arenas.settings import RandomArenaConfig, StartPose, WorldVictims
from sarsim.arenas.start import find_start, moved_to_ground, start_at
from sarsim.assets import asset
from sarsim.ground_truth.meshes import drawn_geoms
from sarsim.sensors.camera import geom_labels
from sarsim.vetting.resolved import resolved_root
from sarsim.vetting.trial import check_model, is_shipped, read_mjcf

BUILDERS: dict[str, Callable[[Path], ArenaBuilder]] = {
    ".raf": build_raf, ".sdf": build_sdf, ".world": build_sdf, ".model": build_sdf, ".yaml": build_map,
}  # fmt: skip
"""The functions that build arenas from files, by the file's extension."""
MAX_GRAVITY_SLOPE = 0.1  # Maximum ratio of gravity's horizontal to its vertical component
MAX_NAMED_BODIES = 5  # Maximum number of bodies that a warning names
FIRST_HIDDEN_GROUP = 3  # Geoms of this group and of higher groups are not drawn
_log = logging.getLogger(__name__)


def load_arena(
    name: str,
    start: StartPose | None = None,
    random: RandomArenaConfig | None = None,
    victims: WorldVictims | None = None,
) -> RescueArena:
    """Load the arena that a command's ``--arena`` names.

    Args:
        name: a built-in arena, ``random:SEED``, or the path of a ``.raf``, MJCF, SDF or 2D map file.
        start: start pose of the robot; by default, the first start in the list of placements, or else the arena's own
            start, or else the best one. In an MJCF file, no start is searched for.
        random: settings of a random arena.
        victims: settings of the victims in an arena built from a file.

    Raises:
        InputError: there is no such arena, its file is missing or broken, an MJCF file has no start, or the robot
            cannot stand at the start.
    """
    check_arena_name(name)
    victims = victims or WorldVictims()
    path, kind = Path(name), Path(name).suffix.lower()
    if kind not in BUILT_EXTENSIONS:
        refuse_placements(name, victims)
    if name in BUILT_IN:
        return _from_mjcf(asset("arenas", f"{name}.xml"), start)
    if name.startswith(RANDOM):
        return _from_builder(name, build_random(seed_of(name), random), start)
    if kind == MJCF_EXTENSION:
        return _from_mjcf(path, start)
    builder = BUILDERS[kind](path)
    listed = _set_victims(name, builder, victims)
    return _from_builder(name, builder, start or listed)


def refuse_placements(name: str, victims: WorldVictims) -> None:
    """Raise InputError if a list of placements is given for an arena that is not built from a file."""
    if victims.placements:
        raise InputError(
            f"--victims {victims.placements}: not supported for the arena {name}; the flag works only with"
            f" {', '.join(BUILT_EXTENSIONS[:-1])} and {BUILT_EXTENSIONS[-1]} files"
        )


def checked_arena(arena: object, name: str, start: StartPose | None = None) -> RescueArena:
    """A checked copy of an arena from other code, with the requested start, or else the arena's own start.

    Raises:
        InputError: ``arena`` is not an arena, MuJoCo cannot build it, or the robot cannot stand at the start. The
            message begins with ``name``.
    """
    if not isinstance(arena, RescueArena):
        raise InputError(
            f"{name}: must return a {RescueArena.__name__}, not an object of type {type(arena).__name__}"
        )
    model, root = resolved_root(arena.mjcf_model, name)
    with prefixing_errors(name):
        check_model(model)
        _check_rules(model, name)
        _set_start(root, model, start, name)
        return RescueArena(root, name)


def _set_victims(name: str, builder: ArenaBuilder, victims: WorldVictims) -> StartPose | None:
    """Add the people in the list of placements, set unknown victim states, and return the list's start, if any."""
    listed = read_placements(victims.placements) if victims.placements else None
    for pose in listed.victims if listed else ():
        add_person(builder, pose)
    settled = builder.set_missing_states(victims.state)
    if settled:
        one = settled == 1
        who, whose = ("1 victim is", "its name gives") if one else (f"{settled} victims are", "their names give")
        _log.warning(
            "%s: %s assumed %s because %s no state; to change this, use --victims-state",
            name, who, victims.state, whose,
        )  # fmt: skip
    return listed.start if listed else None


def _from_mjcf(path: Path, requested: StartPose | None) -> RescueArena:
    model, root = read_mjcf(path)
    with prefixing_errors(str(path)):
        if not is_shipped(path):
            _check_rules(model, str(path))
        _set_start(root, model, requested, str(path))
        return RescueArena(root, str(path))


def _check_rules(model: mujoco.MjModel, name: str) -> None:
    """Warn about each rule for third-party arenas that a model breaks.

    The scores and the true ground assume that movable bodies stay at their initial positions, and ignore drawn shapes
    without a label.

    Raises:
        InputError: gravity does not point downwards, or no shape can collide or is visible.
    """
    if not (model.geom_contype | model.geom_conaffinity).any():
        raise InputError("no shape can collide; give the floor contype and conaffinity of at least 1")
    if not drawn_geoms(model).any():
        raise InputError(
            "no shape is visible; move the shapes that are to be seen to group 0, and give them an alpha"
        )
    x, y, z = model.opt.gravity
    if z >= 0 or np.hypot(x, y) > -z * MAX_GRAVITY_SLOPE:
        raise InputError(f"gravity ({x:g} {y:g} {z:g}) m/s² must point downwards")
    movable = np.flatnonzero(np.isin(model.body_rootid, model.body_rootid[model.jnt_bodyid]))
    if named := [model.body(body).name or f"number {body}" for body in movable]:
        told = ", ".join(named[:MAX_NAMED_BODIES]) + (
            f" and {len(named) - MAX_NAMED_BODIES} more" if len(named) > MAX_NAMED_BODIES else ""
        )
        _log.warning("%s: these bodies can move, but are scored where they are at the start: %s", name, told)
    if unlabelled := np.count_nonzero(
        (geom_labels(model) == Label.UNLABELLED) & (model.geom_group < FIRST_HIDDEN_GROUP)
    ):
        said = (
            "%s: %d of %d shapes have no label, so that what is seen of them is not scored; set user= of their geoms"
        )
        _log.warning(said, name, unlabelled, model.ngeom)


def _set_start(root: mjcf.RootElement, model: mujoco.MjModel, requested: StartPose | None, name: str) -> None:
    """Add the requested start, or else the arena's own start, to ``root``; ``model`` is compiled from ``root``."""
    world, site = _at_rest(model), root.find("site", "start")
    if requested is not None:
        start = start_at(*world, *requested)
        T_world_start = from_yaw(*start.position, start.yaw)
    elif site is not None:
        marked = world[1].site("start")
        T_world_start, changed = moved_to_ground(*world, from_rotation(marked.xmat.reshape(3, 3), marked.xpos))
        if changed:
            _log.warning("%s: %s", name, changed)
    else:
        return
    if site is not None:
        site.remove()
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T_world_start[:3, :3]).ravel())
    root.worldbody.add("site", name="start", pos=T_world_start[:3, 3], quat=quat)


def _from_builder(name: str, builder: ArenaBuilder, requested: StartPose | None) -> RescueArena:
    """The arena from a builder, with the requested start, or else the builder's start, or else the best start."""
    if requested is not None or not builder.has_start:
        world = _at_rest(_compiled(name, builder.to_xml(), builder.files))
        with prefixing_errors(name):
            start = find_start(*world) if requested is None else start_at(*world, *requested)
        builder.set_start(*start)
    return RescueArena(mjcf.from_xml_string(builder.to_xml(), assets=builder.files), name)


def _compiled(name: str, xml: str, files: dict[str, bytes]) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_string(xml, files)
    except (ValueError, mujoco.FatalError) as error:  # for example, if a mesh has no volume
        raise InputError(f"{name}: MuJoCo cannot compile the arena: {' '.join(str(error).split())[:200]}") from error


def _at_rest(model: mujoco.MjModel) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model, and its data with all bodies at their initial poses."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data
