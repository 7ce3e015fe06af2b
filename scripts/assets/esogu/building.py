"""The building around the furniture: walls with doors and windows, columns, ceiling and lamps."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scripts.assets.esogu.parts import Part, moved

Pair = tuple[float, float]

LENGTH, BUILDING_WIDTH, CEILING = 52.0, 15.0, 2.7  # Outer length along x and y, height of the ceiling, m
OUTER, INNER = 0.2, 0.12  # Thickness of the outer and of the inner walls, m
SOUTH_WALL, NORTH_WALL = -0.66, 2.06  # y of the centre lines of the corridor's walls, m
DOOR, DOOR_HEIGHT = 1.0, 2.05  # Clear width and height of a door opening, m
FRAME = 0.03  # Thickness of a door frame, m
PANEL = 2.4
"""Maximum length of a piece of wall, m. Short pieces can be culled outside the image, and give walls enough vertices
for the robot's lamp, whose light is computed per vertex."""
SILL, LINTEL = 0.95, 2.3  # Height of the lower and upper edge of the windows, m
COLUMN = 0.4  # Side of a column, m


@dataclass(frozen=True)
class Room:
    """A room on one side of the corridor.

    Attributes:
        name: what the room is used for.
        west, east: x of the centre lines of its west and east walls, m.
        doors: x of the centre of each door opening, m.
        hinges: for each door, 1 if the open leaf is east of the opening, -1 if it is west, and 0 if there is no leaf.
        windows: x of the centre of each window, m.
    """

    name: str
    west: float
    east: float
    doors: tuple[float, ...]
    hinges: tuple[int, ...]
    windows: tuple[float, ...]


def outer_walls(south: tuple[Room, ...], north: tuple[Room, ...]) -> Iterator[Part]:
    """The four outer walls, with windows in the two long ones."""
    x, y = (LENGTH - OUTER) / 2, (BUILDING_WIDTH - OUTER) / 2
    for end in (-x, x):
        for low, high in _cut(-y + OUTER / 2, y - OUTER / 2):
            yield _wall((end, (low + high) / 2), (OUTER, high - low), 0, CEILING)
    for side, rooms in ((-1, south), (1, north)):
        for low, high in _cut(-LENGTH / 2, LENGTH / 2):
            yield _wall(((low + high) / 2, side * y), (high - low, OUTER), 0, CEILING)
        for window in (w for room in rooms for w in room.windows):
            yield from moved(_window(), window, side * (y - OUTER / 2), -90 * side)


def corridor_wall(y: float, inward: int, rooms: tuple[Room, ...]) -> Iterator[Part]:
    """The wall, with doors, between the corridor and the rooms on one side.

    Args:
        y: y of the wall's centre line, m.
        inward: 1 if the rooms are north of the wall, -1 if they are south of it.
        rooms: the rooms along the wall.
    """
    half = DOOR / 2 + FRAME
    doors = sorted(door for room in rooms for door in room.doors)
    ends = [-LENGTH / 2 + OUTER, *np.ravel([(d - half, d + half) for d in doors]), LENGTH / 2 - OUTER]
    for low, high in zip(ends[::2], ends[1::2], strict=True):
        for a, b in _cut(float(low), float(high)):
            yield _wall(((a + b) / 2, y), (b - a, INNER), 0, CEILING)
    for door in doors:
        yield _wall((door, y), (2 * half, INNER), DOOR_HEIGHT + FRAME, CEILING)
        yield from moved(_door_frame(), door, y, 0)
    for room in rooms:
        for door, hinge in zip(room.doors, room.hinges, strict=True):
            if hinge:
                # The leaf is open by 180°, with a gap to the wall for its handle.
                middle = door + hinge * (DOOR + 2 * FRAME)
                yield from moved(_door_leaf(), middle, y + inward * (INNER / 2 + 0.08), 0)


def partitions(rooms: tuple[Room, ...], low: float, high: float) -> Iterator[Part]:
    """The walls between the rooms on one side of the corridor, from y = ``low`` to ``high``, m."""
    for room in rooms[:-1]:
        for a, b in _cut(low, high):
            yield _wall((room.east, (a + b) / 2), (INNER, b - a), 0, CEILING)


def columns(places: tuple[Pair, ...]) -> Iterator[Part]:
    """Square columns from floor to ceiling."""
    for place in places:
        yield _wall(place, (COLUMN, COLUMN), 0, CEILING, "column")


def ceiling() -> Iterator[Part]:
    """The ceiling in pieces, each with a lamp at its centre."""
    xs = np.linspace(-LENGTH / 2, LENGTH / 2, 14)
    ys = np.array([-BUILDING_WIDTH / 2, SOUTH_WALL, NORTH_WALL, BUILDING_WIDTH / 2])
    for west, east in pairwise(xs):
        for low, high in pairwise(ys):
            x, y = (west + east) / 2, (low + high) / 2
            yield Part("ceiling", "ceiling", (x, y, CEILING + 0.02), (east - west, high - low, 0.04))
            yield Part("ceiling", "lamp", (x, y, CEILING - 0.015), (1.2, 0.3, 0.03))


def _cut(low: float, high: float) -> list[Pair]:
    """The interval from ``low`` to ``high``, cut into equal pieces at most ``PANEL`` long."""
    edges = np.linspace(low, high, 1 + int(np.ceil((high - low) / PANEL - 1e-9)))
    return list(pairwise(edges.tolist()))


def _wall(middle: Pair, extent: Pair, low: float, high: float, material: str = "plaster") -> Part:
    return Part("wall", material, (*middle, (low + high) / 2), (*extent, high - low))


def _window() -> list[Part]:
    """Glass and sill, mounted on the plane x = 0 and facing +x; depth sensors see the glass."""
    height = LINTEL - SILL
    return [
        Part("wall", "glass", (0.005, 0, (SILL + LINTEL) / 2), (0.01, 1.5, height), solid=False),
        Part("wall", "frame", (0.06, 0, SILL - 0.02), (0.12, 1.6, 0.04)),
    ]


def _door_frame() -> list[Part]:
    side = (DOOR + FRAME) / 2
    deep, up = INNER + 0.04, DOOR_HEIGHT / 2
    return [
        Part("wall", "door_frame", (-side, 0, up), (FRAME, deep, DOOR_HEIGHT)),
        Part("wall", "door_frame", (side, 0, up), (FRAME, deep, DOOR_HEIGHT)),
        Part("wall", "door_frame", (0, 0, DOOR_HEIGHT + FRAME / 2), (DOOR + 2 * FRAME, deep, FRAME)),
    ]


def _door_leaf() -> list[Part]:
    handle = (0.12, 0.1, 0.025)
    return [
        Part("wall", "door", (0, 0, DOOR_HEIGHT / 2), (DOOR - 0.02, 0.04, DOOR_HEIGHT - 0.02)),
        Part("wall", "steel", (0, 0, 1.05), handle, solid=False),
    ]
