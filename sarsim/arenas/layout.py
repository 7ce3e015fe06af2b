"""The plan of a random arena: a grid of tiles whose walls, ground and elements are described by integers."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

Tile = tuple[int, int]  # Column and row
Side = int  # 0 to 3: east, north, west, south, that is +x, +y, -x, -y
Edge = tuple[Tile, Side]
"""A side of a tile; an edge between two tiles is always given as the east or north side of one of them."""

NEIGHBOUR_OFFSETS: tuple[Tile, ...] = ((1, 0), (0, 1), (-1, 0), (0, -1))
SIDES: tuple[Side, ...] = (0, 1, 2, 3)
YAW = (270, 0, 90, 180)  # Yaw, degrees, at which an element's +y side, which has the wall, faces each side


def opposite(side: Side) -> Side:
    """The opposite side of a tile."""
    return (side + 2) % 4


def shift(front: Side, ahead: int, aside: int) -> Tile:
    """Offset along x and y, cm: ``ahead`` cm towards side ``front`` and ``aside`` cm to the left when facing it."""
    (fx, fy), (lx, ly) = NEIGHBOUR_OFFSETS[front], NEIGHBOUR_OFFSETS[(front + 1) % 4]
    return ahead * fx + aside * lx, ahead * fy + aside * ly


@dataclass(frozen=True)
class TileGround:
    """The ground of a tile.

    Attributes:
        kind: floor, a deck, a ramp, a ridge (up and down again), or blocked for the robot.
        level: height of a deck, of a ramp's upper end, or of a ridge, cm.
        uphill: side at a ramp's upper end; for a ridge, one of the two sides that the robot can cross.
    """

    kind: Literal["floor", "deck", "ramp", "ridge", "blocked"] = "floor"
    level: int = 0
    uphill: Side = 0

    def level_at(self, side: Side) -> int | None:
        """Height of the ground at a side, cm; None if the robot cannot leave the tile over this side."""
        if self.kind in ("floor", "deck"):
            return self.level
        if self.kind == "blocked" or side % 2 != self.uphill % 2:
            return None
        return self.level if self.kind == "ramp" and side == self.uphill else 0


FLOOR = TileGround()
BLOCKED = TileGround("blocked")


@dataclass(frozen=True)
class Item:
    """A library element on a tile.

    Attributes:
        tile: the tile on which the element stands.
        kind: name of the element in the library.
        yaw: angle by which the element is turned to the left, degrees.
        shift: offset along x and y from the tile's centre, cm.
    """

    tile: Tile
    kind: str
    yaw: int = 0
    shift: tuple[int, int] = (0, 0)


class Layout:
    """A grid of tiles, with walls between some tiles and around the arena.

    Attributes:
        columns, rows: numbers of tiles along x and y.
        walls: edges inside the arena that have a wall.
        reserved: tiles that must not be changed.
        start: tile on which the robot starts; None until a tile is chosen.
    """

    def __init__(self, columns: int, rows: int):
        self.columns, self.rows = columns, rows
        self.walls: set[Edge] = set()
        self.reserved: set[Tile] = set()
        self.start: Tile | None = None
        self._ground: dict[Tile, TileGround] = {}

    def tiles(self) -> list[Tile]:
        """All tiles, row by row."""
        return [(i, j) for j in range(self.rows) for i in range(self.columns)]

    def inner_edges(self) -> list[Edge]:
        """All edges between two tiles."""
        return [(t, s) for t in self.tiles() for s in (0, 1) if self.neighbour(t, s) is not None]

    def neighbour(self, tile: Tile, side: Side) -> Tile | None:
        """The neighbouring tile on a side; None at the arena's border."""
        i, j = self.next(tile, side)
        return (i, j) if 0 <= i < self.columns and 0 <= j < self.rows else None

    def edge(self, tile: Tile, side: Side) -> Edge:
        """The unique form of the edge on a side of a tile; see ``Edge``."""
        other = self.neighbour(tile, side)
        return (other, opposite(side)) if side >= 2 and other is not None else (tile, side)

    def has_wall(self, tile: Tile, side: Side) -> bool:
        """Whether there is a wall on a side of a tile; always true at the arena's border."""
        return self.neighbour(tile, side) is None or self.edge(tile, side) in self.walls

    def ground(self, tile: Tile) -> TileGround:
        """The ground of a tile."""
        return self._ground.get(tile, FLOOR)

    def is_free(self, tile: Tile) -> bool:
        """Whether the tile is floor and not reserved."""
        return self.ground(tile) == FLOOR and tile not in self.reserved

    def is_passable(self, tile: Tile, side: Side) -> bool:
        """Whether the robot can drive over this side to the next tile."""
        other = self.neighbour(tile, side)
        if other is None or self.has_wall(tile, side):
            return False
        level = self.ground(tile).level_at(side)
        return level is not None and level == self.ground(other).level_at(opposite(side))

    def exits(self, tile: Tile) -> list[Side]:
        """Sides over which the robot can leave a tile."""
        return [side for side in SIDES if self.is_passable(tile, side)]

    def is_connected(self) -> bool:
        """Whether the robot can drive between any two tiles that are not blocked."""
        open_tiles = {t for t in self.tiles() if self.ground(t) != BLOCKED}
        return not open_tiles or self._reachable_from(min(open_tiles), self.is_passable) == open_tiles

    def is_explorable(self) -> bool:
        """Whether the robot, driving only over ground that it has seen, can reach all floor, decks and ramps."""
        seen = set() if self.start is None else self._reachable_from(self.start, self._is_passable_in_sight)
        return all(t in seen for t in self.tiles() if self.ground(t).kind not in ("ridge", "blocked"))

    def _is_passable_in_sight(self, tile: Tile, side: Side) -> bool:
        """Whether the robot can drive over this side and can see the ground beyond the side in advance.

        The robot's camera sees nothing nearer than 0.8 m. The tile before a ramp or ridge must therefore be preceded
        by a floor tile, from which the robot can see the ramp or ridge. Between two ridges, the result is False,
        because the robot cannot see the far slope of the last ridge in a row.
        """
        if not self.is_passable(tile, side):
            return False
        here, there = self.ground(tile).kind, self.ground(self.next(tile, side)).kind
        if here == "floor" and there in ("ramp", "ridge"):
            back = opposite(side)
            return self.is_passable(tile, back) and self.ground(self.next(tile, back)) == FLOOR
        return here != "ridge" or there != "ridge"

    def _reachable_from(self, start: Tile, may_pass: Callable[[Tile, Side], bool]) -> set[Tile]:
        seen, queue = {start}, deque([start])
        while queue:
            tile = queue.popleft()
            for side in SIDES:
                if may_pass(tile, side) and (other := self.next(tile, side)) not in seen:
                    seen.add(other)
                    queue.append(other)
        return seen

    def next(self, tile: Tile, side: Side) -> Tile:
        """The neighbouring tile on a side, which may be outside the arena."""
        return tile[0] + NEIGHBOUR_OFFSETS[side][0], tile[1] + NEIGHBOUR_OFFSETS[side][1]

    def tiles_towards(self, tile: Tile, side: Side, length: int) -> list[Tile]:
        """A row of ``length`` tiles from ``tile`` towards ``side``; shorter if the arena's border is nearer."""
        tiles = [tile]
        while len(tiles) < length and (after := self.neighbour(tiles[-1], side)) is not None:
            tiles.append(after)
        return tiles

    def try_lay(self, grounds: Iterable[tuple[Tile, TileGround]], opened: Iterable[Edge] = ()) -> bool:
        """Change ground and remove walls if the robot can still explore all tiles; return whether it can."""
        before = (dict(self._ground), set(self.walls))
        self._ground.update(grounds)
        self.walls.difference_update(opened)
        if self.is_connected() and (self.start is None or self.is_explorable()):
            return True
        self._ground, self.walls = before
        return False

    def try_block(self, tiles: list[Tile]) -> bool:
        """Block free tiles if they are visible from open floor and the robot can still explore all other tiles.

        Walls between the blocked tiles are removed. The result is True if the tiles were blocked.
        """
        if not all(self.is_free(t) for t in tiles) or not self.viewing_sides(tiles):
            return False
        between = [self.edge(t, s) for t in tiles for s in SIDES if self.next(t, s) in tiles]
        return self.try_lay([(t, BLOCKED) for t in tiles], between)

    def viewing_sides(self, tiles: list[Tile]) -> list[Edge]:
        """Sides of the given tiles, as (tile, side), through which the tiles are visible from open floor."""
        return [
            (tile, side)
            for tile in tiles
            for side in SIDES
            if (other := self.neighbour(tile, side)) is not None
            and other not in tiles
            and not self.has_wall(tile, side)
            and self.ground(other) == FLOOR
        ]

    def walls_of(self, tile: Tile) -> list[Side]:
        """The sides of a tile that have a wall."""
        return [side for side in SIDES if self.has_wall(tile, side)]
