"""Hangs objects to find on the walls of a random arena."""

from collections.abc import Callable
from itertools import islice

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rotation3
from pipeline.tracks.find import HAZMAT_CLASSES
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.random_draws import RandomDraws
from sarsim.arenas.things.codes import RESERVED_TAGS, TAG_DICTIONARY, TAG_SIDE
from sarsim.arenas.things.dolls import doll
from sarsim.arenas.things.hazmat import SignStyle
from sarsim.arenas.things.models import (
    PAPER_THICKNESS,
    ThingModel,
    april_tag,
    door_lever,
    fire_extinguisher,
    hazmat_sign,
    qr_code,
)
from sarsim.arenas.things.thing import ALIVE, DEAD, data_of
from sarsim.arenas.walls import VIEWING_DISTANCE, Walls, wall_axes
from sarsim.victims.mjcf import about_z

WALL_ROOM = 0.25  # m of flat wall in each direction: half a doll's box, and more than half the diagonal of any sign
THING_SPACING = 0.6  # m between objects, so that they do not touch
MAX_RISE, MIN_RISE = 0.25, -0.15
"""m above ``walls.SIGHT_HEIGHT``, limits of the objects' heights due to the camera's field of view."""
DEAD_FRACTION = 1 / 3  # Fraction of the people and dolls who are dead
SIGN_SIDES = (0.10, 0.15, 0.20, 0.25)  # m, sides of hazmat signs: labels on UN packages have 0.1 m, placards 0.25 m
CODE_SIDES = (0.10, 0.14, 0.18)  # m, sides of QR codes
STANDING_AXES = np.array([(1.0, 0, 0), (0, 0, 1.0), (0, -1.0, 0)])
"""Axes of an object that stands with its back to a wall (x right, z up) in the frame of an object on the wall."""
CODE_LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
DOLL_BOX_DEPTH = 0.59  # m from a doll's origin to the back of its box
BRACKET_DEPTH = 0.11  # m from the wall to the axis of a fire extinguisher, the depth of its bracket
TILTED_FRACTION = 0.3  # Fraction of the signs that hang at a random angle instead of standing on a corner


def hang_things(builder: ArenaBuilder, number: int, rng: np.random.Generator) -> None:
    """Hang up to ``number`` objects, of all kinds in turn, on walls next to drivable ground.

    If ``number`` is above 0, also declare some of the people dead.
    """
    if not number:
        return
    draws = RandomDraws(rng)
    _declare_some_dead(builder, draws)
    model = mujoco.MjModel.from_xml_string(builder.to_xml(), builder.files)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    start = data.site("start").xpos
    walls, rises = Walls(model, start), rng.uniform(MIN_RISE, MAX_RISE, number)
    hung = 0

    def fits(point: NDArray[np.float64], normal: NDArray[np.float64]) -> bool:
        # A box beside the start would obstruct the robot.
        is_beside_start = np.linalg.norm((point - start)[:2]) < VIEWING_DISTANCE
        return not is_beside_start and walls.has_room(point, normal, WALL_ROOM, rises[hung])

    for point, normal in islice(walls.spread_places(rng, THING_SPACING, fits), number):
        _hang(builder, draws, hung, point + np.array([0.0, 0.0, rises[hung]]), normal)
        hung += 1


def _declare_some_dead(builder: ArenaBuilder, draws: RandomDraws) -> None:
    """Declare each person in the arena dead with probability ``DEAD_FRACTION``."""
    for text in builder.root.findall("custom/text"):
        if text.get("data") == data_of("victim", state=ALIVE) and draws.chance(DEAD_FRACTION):
            text.set("data", data_of("victim", state=DEAD))


def _hang(
    builder: ArenaBuilder, draws: RandomDraws, turn: int, point: NDArray[np.float64], normal: NDArray[np.float64]
) -> None:
    """Hang object number ``turn``, counted from 0, at ``point`` (3,) m of a wall with ``normal`` (3,)."""
    kind, R = KINDS_IN_TURN[turn % len(KINDS_IN_TURN)], wall_axes(normal)
    if kind == "doll":
        _hang_doll(builder, draws, point + DOLL_BOX_DEPTH * normal, R @ STANDING_AXES)
        return
    thing = MODEL_MAKERS[kind](f"{kind}_{builder.next_thing_number}", draws)
    if kind == "fire_extinguisher":
        builder.add_thing(thing, point + BRACKET_DEPTH * normal - [0.0, 0.0, WALL_ROOM], R @ STANDING_AXES)
        return
    tilt = draws.rng.uniform(-np.pi, np.pi) if kind == "hazmat_sign" and draws.chance(TILTED_FRACTION) else 0.0
    builder.add_thing(thing, point + (kind != "door_lever") * PAPER_THICKNESS * normal, R @ about_z(tilt))


def _hang_doll(builder: ArenaBuilder, draws: RandomDraws, position: NDArray[np.float64], R: Rotation3) -> None:
    """Hang a doll in its box; the origin of both is at ``position`` (3,) m, and their axes are ``R`` (3, 3)."""
    state = DEAD if draws.chance(DEAD_FRACTION) else ALIVE
    builder.add_element("victim_with_box", position, float(np.degrees(np.arctan2(R[1, 0], R[0, 0]))))
    builder.add_thing(doll(builder.next_victim_name, state, draws.rng), position, R)


def _sign(name: str, draws: RandomDraws) -> ThingModel:
    paper = draws.pick((0.0, 0.0, 0.02, 0.04))
    return hazmat_sign(name, draws.pick(HAZMAT_CLASSES), draws.pick(SIGN_SIDES), SignStyle.random(draws.rng), paper)


def _code(name: str, draws: RandomDraws) -> ThingModel:
    text = "".join(draws.pick(CODE_LETTERS) for _ in range(draws.number(4, 14)))
    return qr_code(name, text, draws.pick(CODE_SIDES))


def _tag(name: str, draws: RandomDraws) -> ThingModel:
    # Lower numbers are reserved for the tags that are used to score maps.
    return april_tag(name, draws.number(RESERVED_TAGS, len(TAG_DICTIONARY.bytesList) - 1), TAG_SIDE)


def _extinguisher(name: str, draws: RandomDraws) -> ThingModel:
    radius = draws.number(55, 80) / 1000
    return fire_extinguisher(name, radius, draws.number(36, 48) / 100, draws.number(0, 2), draws.number(0, 2))


def _lever(name: str, draws: RandomDraws) -> ThingModel:
    return door_lever(name, draws.number(11, 14) / 100, draws.chance(0.5))


MODEL_MAKERS: dict[str, Callable[[str, RandomDraws], ThingModel]] = {
    "hazmat_sign": _sign,
    "qr_code": _code,
    "april_tag": _tag,
    "fire_extinguisher": _extinguisher,
    "door_lever": _lever,
}
KINDS_IN_TURN = ("hazmat_sign", "qr_code", "doll", "april_tag", "hazmat_sign", "fire_extinguisher", "door_lever")
"""The kinds of objects in the order in which they are hung."""
