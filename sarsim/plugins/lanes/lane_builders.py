"""Builders of RoboCup Rescue lanes with the fabrication guide's dimensions; docs/arenas.md lists the assumptions."""

from collections.abc import Callable
from math import cos, pi, radians, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from sarsim.arenas.elements import ArenaBuilder
from sarsim.plugins.lanes.lane_parts import (
    TIMBER,
    Deck,
    add_body,
    add_end_railings,
    add_floor,
    add_four_floors,
    add_hall,
    add_side_railings,
    rotation,
)
from sarsim.plugins.lanes.lanes import DIMENSIONS as D
from sarsim.plugins.lanes.lanes import HOLES_END_DISTANCE

YELLOW, ORANGE, PIPE = (0.93, 0.78, 0.16), (0.93, 0.50, 0.12), (0.80, 0.80, 0.82)
RAILS_START, STEPS_START = 0.2, 0.3  # m inwards from an end zone's centre, so that the robot fits between obstacles


def build_lane(lane: str, end: int = -1) -> ArenaBuilder:
    """Build a lane; the robot starts in the end zone at negative (``end`` = -1) or positive x, facing the lane."""
    builder = ArenaBuilder(lane)
    BUILDERS[lane](builder, end)
    return builder


def _set_start(decks: list[Deck], end: int, inwards: float = 0.0, y: float = 0.0) -> None:
    """Set the start: on an outer floor, ``inwards`` m from its centre and ``y`` m to the left, facing the lane."""
    deck = decks[0] if end < 0 else decks[-1]
    deck.set_start(-end * inwards, -end * y, 0.0 if end < 0 else pi)


def _crossing_ramps(builder: ArenaBuilder, end: int) -> None:
    """Build ridges of half ramps, offset by half a ridge between left and right; this arrangement is assumed."""
    decks = add_four_floors(builder)
    half = D.width / 4
    wedge = _wedge(D.half_ramp, D.width / 2, D.half_ramp * tan(radians(D.slope)))
    for n in range(4):
        x = (n % 2 - 0.5) * D.half_ramp
        for side in (-1, 1):
            rises = 1 if (n % 2 == 0) == (side > 0) else -1
            decks[1 + n // 2].add_hull("inclined_ramp", (x, side * half, 0.0), wedge * (rises, 1, 1))
    _set_start(decks, end)


def _wedge(length: float, width: float, height: float) -> NDArray[np.float64]:
    """(6, 3) m, vertices of a ramp that rises along x; the origin is at the centre of its base."""
    x, y = length / 2, width / 2
    return np.array([(-x, -y, 0), (-x, y, 0), (x, -y, 0), (x, y, 0), (x, -y, height), (x, y, height)])


def _krails(builder: ArenaBuilder, end: int, ridge: bool = False) -> None:
    """Build a diagonal rail on each of eight squares; four of the rails meet at the centre of the lane."""
    decks = add_four_floors(builder, ridge)
    for column, deck in enumerate(decks):
        for row in (0, 1):
            way = 1 if (column + row) % 2 else -1
            deck.add_hull("wall", (0.0, (row - 0.5) * D.floor, 0.0), _mitred_rail() * (way, 1, 1), TIMBER)
    _set_start(decks, end, RAILS_START)


def _mitred_rail() -> NDArray[np.float64]:
    """(12, 3) m, vertices of a rail along the diagonal of a 1.2 m square, with ends mitred to fit the corners."""
    side, cut = D.floor / 2, D.rail / sqrt(2)
    half = [(-side, -side), (cut - side, -side), (side, side - cut)]
    outline = [*half, *((-x, -y) for x, y in half)]
    return np.array([(x, y, z) for x, y in outline for z in (0.0, D.rail)])


def _krails_15(builder: ArenaBuilder, end: int) -> None:
    _krails(builder, end, ridge=True)


def _stepfield(builder: ArenaBuilder, end: int) -> None:
    """Build zigzag ridges of high plateaus with low plateaus on both sides; the zigzag's direction is assumed."""
    decks = add_four_floors(builder)
    middle = (D.cell - D.plateau) / 2
    for column, deck in enumerate(decks):
        for i in range(4):
            for j in range(8):
                falls = (column + j // 4) % 2 == 0
                off = abs(i + j % 4 - 3) if falls else abs(i - j % 4)
                height = (D.high, D.low, 0.0)[min(off, 2)]
                # Along each axis, two plateaus fill a base of 59.4 cm, and two bases fit on a floor of 1.2 m.
                x, y = ((n // 2 + 0.5) * D.floor / 2 + (n % 2 * 2 - 1) * middle for n in (i, j))
                if height:
                    place = (x - D.floor / 2, y - D.width / 2, height / 2)
                    colour = ORANGE if height == D.high else YELLOW
                    deck.add_box("straight_ramp", place, (D.plateau, D.plateau, height), colour=colour)
    _set_start(decks, end, STEPS_START)


def _pitch_roll(builder: ArenaBuilder, end: int) -> None:
    """Build eight elements of four ramps, alternately peaks (rising clockwise) and valleys (falling clockwise)."""
    decks = add_four_floors(builder)
    wedge = _wedge(D.cell, D.cell, D.ramp_height)
    for column, deck in enumerate(decks):
        for row in (0, 1):
            peak = (column + row) % 2 == 0
            for quarter in range(4):
                # Clockwise from the north-west quarter, each ramp is turned right by another 90°.
                a = pi / 4 * (3 - 2 * quarter)
                x, y = D.floor / 4 * np.sign([cos(a), sin(a)])
                R = rotation(-pi / 2 * quarter + (0.0 if peak else pi))
                deck.add_hull("inclined_ramp", (x, y + (row - 0.5) * D.floor, 0.0), wedge @ R.T)
    _set_start(decks, end, y=D.floor / 2)  # in a valley


def _hurdles(builder: ArenaBuilder, end: int) -> None:
    """Build a pallet on each square, a second on two squares, and a pipe in front of each step to a second pallet."""
    decks = add_four_floors(builder)
    for column, deck in enumerate(decks):
        for row in (0, 1):
            layers = 2 if (column, row) in ((1, 0), (2, 1)) else 1
            size = (D.floor, D.width / 2, layers * D.pallet)
            deck.add_box("straight_ramp", (0.0, (row - 0.5) * D.floor, size[2] / 2), size)
    radius, length = D.pipe[0] / 2, D.pipe[1]
    for column, row, side in ((0, 0, 1), (2, 0, -1), (1, 1, 1), (3, 1, -1)):
        place = (side * (D.floor / 2 - radius), (row - 0.5) * D.floor, D.pallet + radius)
        pose = decks[column].pose(place, rotation(pi / 2) @ rotation(0.0, pi / 2))
        builder.add_geom("clutter", {**pose, "type": "cylinder", "size": (radius, length / 2)}, PIPE)
    top = [Deck(builder, deck.point(0.0, 0.0, D.pallet), deck.R) for deck in decks]
    _set_start(top, end)


def _alleys(builder: ArenaBuilder, end: int, tilt: float = 0.0) -> None:
    """Build three dividers across the lane, with doorways at the south, north and south side in turn."""
    flat = [Deck(builder, np.array([x * D.floor, 0.0, 0.0])) for x in (-1.5, -0.5)]
    far = Deck(builder, np.zeros(3), rotation(0.0, tilt))  # frame of both tilted floors, origin at their hinge
    for deck in flat:
        add_floor(deck)
        add_side_railings(deck)
    for y in (-0.5, 0.5):
        add_floor(Deck(builder, far.point(D.floor, y * D.floor), far.R), 2 * D.floor, D.floor)
    halves = [Deck(builder, far.point(x * D.floor, 0.0), far.R) for x in (0.5, 1.5)]
    for deck in halves:
        add_side_railings(deck)
    add_end_railings([*flat, *halves])
    for deck, x, side in ((flat[0], D.floor / 2, -1), (flat[1], D.floor / 2, 1), (halves[0], D.floor / 2, -1)):
        _divider(deck, x, side)
    add_hall(builder, (-4.4, -3.2), (4.4, 3.2), D.framing + D.board)
    deck = flat[0] if end < 0 else halves[1]
    deck.set_start(0.0, D.floor / 2, -pi / 2)  # along the alley, because the next divider is too near to be measured


def _divider(deck: Deck, x: float, side: int) -> None:
    """Add a railing to one half of the lane, and to the other a panel that leaves a doorway at y of sign ``side``."""
    length, height = D.panel
    deck.railing(x, -side * D.railing / 2, pi / 2)
    middle = side * (D.width / 2 - D.passage - length / 2)
    deck.add_box("wall", (x - D.lumber[0], middle, height / 2), (D.board, length, height))


def _centre(builder: ArenaBuilder, end: int) -> None:
    _alleys(builder, end, radians(D.slope))


def _traverse(builder: ArenaBuilder, end: int) -> None:
    """Build a lane across a side slope, between panels.

    The guide has no such lane; sloping all four floors is our choice.
    """
    R = rotation(0.0, 0.0, radians(D.slope))
    rise = D.width / 2 * sin(radians(D.slope))
    decks = [
        Deck(builder, np.array([x * D.floor, 0.0, rise]) + R @ np.array([0.0, y * D.offset, 0.0]), R)
        for x, y in ((-1.5, 1), (-0.5, 0), (0.5, 0), (1.5, -1))
    ]
    for deck in decks:
        add_floor(deck)
        add_side_railings(deck)
    add_end_railings(decks)
    between, height = (D.width - D.passage) / 2, D.panel[1]
    for deck, outer in zip(decks[1:3], (-1, 1), strict=True):
        for side in (-1, 1):
            deck.add_box("wall", (0.0, side * (D.passage + D.board) / 2, height / 2), (D.floor, D.board, height))
            middle = outer * (D.floor - D.board) / 2, side * (D.passage + between) / 2, height / 2
            deck.add_box("wall", middle, (D.board, between, height))
    add_hall(builder, (-4.4, -3.2), (4.4, 3.2), D.framing + D.board)
    _set_start(decks, end)


def _door(builder: ArenaBuilder, end: int, shut: bool = False) -> None:
    """Build a wall across the lane, with a door in its left half whose leaf is open, or ``shut``."""
    decks = add_four_floors(builder)
    across = Deck(builder, np.zeros(3))
    thick, half = D.lumber[1], D.width / 4
    across.add_box("wall", (0.0, -half, D.wall / 2), (thick, D.width / 2, D.wall))
    jamb = (D.width / 2 - D.gate) / 2
    for y in (jamb / 2, D.width / 2 - jamb / 2):
        across.add_box("wall", (0.0, y, D.door / 2), (thick, jamb, D.door))
    _leaf(builder, jamb, thick, shut)
    _set_start(decks, end)


def _leaf(builder: ArenaBuilder, jamb: float, thick: float, shut: bool) -> None:
    """Add the door's leaf, hinged on the jamb nearest to the lane's centre line; the leaf opens towards +x."""
    gap, board = 0.005, 0.04  # m, gap around the leaf and its thickness
    opens = radians(D.leaf_angle)
    joint = {"type": "hinge", "axis": (0, 0, 1), "damping": (2.0,), "frictionloss": (1.0,)}
    joint |= {"range": (-opens, 0), "stiffness": (D.leaf_spring,)} if shut else {"range": (0, opens)}
    heading = pi / 2 if shut else pi / 2 - opens
    half = np.array([D.gate / 2 - gap, board / 2, D.door / 2 - gap])
    R = rotation(heading)
    geom = {
        "type": "box",
        "pos": R @ np.array([half[0] + gap, 0.0, 0.0]),
        "quat": (cos(heading / 2), 0, 0, sin(heading / 2)),
        "size": half,
        "mass": (D.leaf_mass,),
    }
    add_body(builder, "leaf", (thick / 2, jamb, D.door / 2 + gap), joint, geom)


def _door_shut(builder: ArenaBuilder, end: int) -> None:
    _door(builder, end, shut=True)


HOLES_ROUTE = ((1, 0), (0, 1), (1, 0), (0, -1), (1, 0))
"""Directions of the runs between the holes; this route is assumed."""


def _avoid_holes(builder: ArenaBuilder, end: int) -> None:
    """Build a winding path of five runs of two pallets, with a gate of loose posts on each run's second pallet."""
    long, wide, high = D.hole_pallet
    turn = (long + wide) / 2
    ground = Deck(builder, np.zeros(3))
    at = np.array([-HOLES_END_DISTANCE + long / 2 - turn, -(turn + long) / 2])
    for number, run in enumerate(HOLES_ROUTE):
        heading = np.array(run, np.float64)
        size = (long, wide, high) if run[0] else (wide, long, high)
        for pallet, step in enumerate((turn, long)):
            at = at + step * heading
            ground.add_box("terrain", (*at, -high / 2), size, colour=TIMBER)
            if pallet == 1:
                # A post in the middle of the pallet would block the next run, which starts there.
                _gate(builder, number + 1, at - (long - D.lumber[1]) / 2 * heading, heading)
    length, width = 2 * (HOLES_END_DISTANCE + D.floor), turn + long + wide
    for side in (-1, 1):
        ground.add_box(
            "terrain",
            (side * (HOLES_END_DISTANCE + D.floor / 2), 0.0, -high / 2),
            (D.floor, width, high),
            colour=TIMBER,
        )
        ground.add_box("wall", (0.0, side * (width / 2 + D.wall_distance), D.wall / 2 - high), (length, 0.02, D.wall))
        ground.add_box(
            "wall",
            (side * (HOLES_END_DISTANCE + D.floor + 0.01), 0.0, D.wall / 2 - high),
            (0.02, width + 2 * D.wall_distance, D.wall),
        )
    add_hall(builder, (-HOLES_END_DISTANCE - 2 * D.floor, -width), (HOLES_END_DISTANCE + 2 * D.floor, width), high)
    ground.set_start(end * (HOLES_END_DISTANCE + D.floor / 2), at[1], 0.0 if end < 0 else pi)


def _gate(builder: ArenaBuilder, number: int, at: NDArray[np.float64], heading: NDArray[np.float64]) -> None:
    """Add two posts on a pallet, one on each side of the path."""
    thick, deep = D.lumber
    across = np.array([-heading[1], heading[0]])
    half = np.abs(thick * across + deep * heading) / 2
    for name, side in (("a", -1), ("b", 1)):
        x, y = at + side * (D.gate + thick) / 2 * across
        geom = {"type": "box", "size": (*half, D.post / 2), "mass": (D.post_mass,)}
        add_body(builder, f"post_{number}{name}", (x, y, D.post / 2), {"type": "free"}, geom)


BUILDERS: dict[str, Callable[[ArenaBuilder, int], None]] = {
    "alleys": _alleys,
    "avoid_holes": _avoid_holes,
    "centre": _centre,
    "crossing_ramps": _crossing_ramps,
    "door": _door,
    "door_shut": _door_shut,
    "hurdles": _hurdles,
    "krails": _krails,
    "krails_15": _krails_15,
    "pitch_roll": _pitch_roll,
    "stepfield": _stepfield,
    "traverse": _traverse,
}
