"""Generates rows of furniture that is easily confused with walls, ramps and decks, in many sizes and colours.

A piece of furniture consists of boxes, in whole cm in the frame of its tile, and has its back at +y. The headroom
under tables is too low for the robot, and only stairs have a surface as low as a deck.
"""

from collections.abc import Callable
from dataclasses import dataclass

from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.layout import YAW, Layout, Side, Tile, opposite
from sarsim.arenas.random_draws import RandomDraws
from sarsim.arenas.random_paint import Colour, random_colour

Box = tuple[int, int, int, int, int, int]  # x0, x1, y0, y1, z0, z1, cm
BACK_Y = 59  # cm, y of the back of a piece; the face of the wall is at 59.5
HALF_WIDTH = 59  # cm, half width of a piece that fills its tile up to a narrow gap to the next piece
MAX_ROW_LENGTH = 4  # Maximum number of tiles in a row with the same piece


@dataclass(frozen=True)
class Piece:
    """A piece of furniture on a tile.

    Attributes:
        tile: the tile on which the piece stands.
        yaw: angle by which the piece is turned to the left, degrees.
        boxes: boxes that make up the piece.
        colours: colours of the boxes, used in turn.
    """

    tile: Tile
    yaw: int
    boxes: tuple[Box, ...]
    colours: tuple[Colour, ...]

    def add_to(self, builder: ArenaBuilder, x: float, y: float) -> None:
        """Add the piece to an arena, with the centre of its tile at ``x``, ``y``, m."""
        for number, (x0, x1, y0, y1, z0, z1) in enumerate(self.boxes):
            middle = ((x0 + x1) / 200, (y0 + y1) / 200, (z0 + z1) / 200)
            half = ((x1 - x0) / 200, (y1 - y0) / 200, (z1 - z0) / 200)
            colour = self.colours[number % len(self.colours)]
            builder.add_box("furniture", "clutter", (x, y, 0.0), self.yaw, middle, half, colour)


def furnish(layout: Layout, draws: RandomDraws, fraction: float) -> list[Piece]:
    """Place pieces of one tile each until they fill a ``fraction`` of the tiles or no further tile can be blocked."""
    wanted = round(fraction * len(layout.tiles()))
    pieces: list[Piece] = []
    for tile in draws.shuffled(layout.tiles()):
        fronts = [side for _, side in layout.viewing_sides([tile])]
        against_wall = [side for side in fronts if layout.has_wall(tile, opposite(side))]
        if len(pieces) >= wanted or not layout.is_free(tile) or not fronts:
            continue
        back = opposite(draws.pick(against_wall or fronts))
        boxes = tuple(draws.pick(FURNITURE if against_wall else FREESTANDING)(draws))
        colours = tuple(random_colour(draws) for _ in range(draws.number(1, 3)))
        for place in _row(layout, draws, tile, back)[: wanted - len(pieces)]:
            if layout.try_block([place]):
                pieces.append(Piece(place, YAW[back], boxes, colours))
    return pieces


def _row(layout: Layout, draws: RandomDraws, tile: Tile, back: Side) -> list[Tile]:
    """A row along the side ``back``: ``tile`` and a random number of free tiles next to it, with no walls between."""
    row, along = [tile], draws.pick(((back + 1) % 4, (back + 3) % 4))
    for _ in range(draws.number(0, MAX_ROW_LENGTH - 1)):
        if layout.has_wall(row[-1], along) or not layout.is_free(layout.next(row[-1], along)):
            break
        row.append(layout.next(row[-1], along))
    return row


def _cupboard(draws: RandomDraws) -> list[Box]:
    """A locker, cupboard or counter: an upright box, which usually has one to four slightly protruding doors."""
    half, height = draws.pick((HALF_WIDTH, HALF_WIDTH, draws.number(25, HALF_WIDTH))), draws.number(70, 200)
    front, doors = BACK_Y - draws.number(25, 65), draws.number(1, 4)
    width, slit, relief = 2 * half // doors, draws.number(1, 3), draws.number(1, 3)
    boxes = [(-half, half, front, BACK_Y, draws.pick((0, 0, 10)), height)]
    for door in range(doors if draws.chance(0.8) else 0):
        left = -half + door * width
        boxes.append((left + slit, left + width - slit, front - relief, front, draws.number(4, 12), height - slit))
    return boxes


def _shelf(draws: RandomDraws) -> list[Box]:
    """An open shelf, with or without a back, with boxes on some of its boards."""
    half, height, depth, board = (
        draws.number(35, HALF_WIDTH),
        draws.number(90, 200),
        draws.number(25, 50),
        draws.number(2, 4),
    )
    front, between = BACK_Y - depth, draws.number(25, 50)
    boxes = [(side * half - 1, side * half + 1, front, BACK_Y, 0, height) for side in (-1, 1)]
    boxes += [(-half, half, BACK_Y - 1, BACK_Y, 0, height)] * draws.number(0, 1)
    for z in range(draws.number(4, 15), height, between):
        boxes.append((-half, half, front, BACK_Y, z, z + board))
        if draws.chance(0.6):
            left, set_back = draws.number(-half, half - 16), draws.number(0, depth // 2)
            right = draws.number(left + 15, half)
            boxes.append((left, right, front + set_back, BACK_Y, z + board, z + board + draws.number(8, between - 6)))
    return boxes


def _wall_shelf(draws: RandomDraws) -> list[Box]:
    """Boards or a cupboard on the wall, at a random height."""
    half, front, low = draws.number(30, HALF_WIDTH), BACK_Y - draws.number(18, 42), draws.number(35, 110)
    if draws.chance(0.4):
        return [(-half, half, front, BACK_Y, low, low + draws.number(30, 80))]
    spacing = draws.number(25, 40)
    return [(-half, half, front, BACK_Y, z, z + 3) for z in range(low, low + spacing * draws.number(1, 3), spacing)]


def _table(draws: RandomDraws) -> list[Box]:
    """A table, desk or bench, 40 to 95 cm high, on legs or panels, with or without an apron."""
    half, depth, height = draws.number(35, HALF_WIDTH), draws.number(40, 110), draws.number(40, 95)
    front, leg, top = BACK_Y - depth, draws.number(3, 8), draws.number(2, 5)
    below = min(height - top - draws.number(0, 10), 60)
    boxes = [(-half, half, front, BACK_Y, height - top, height)]
    boxes += [(3 - half, half - 3, front + 3, BACK_Y - 3, below, height - top)] * (below < height - top)
    ends = ((front, front + leg), (BACK_Y - leg, BACK_Y)) if draws.chance(0.6) else ((front, BACK_Y),)
    boxes += [(x, x + leg, y0, y1, 0, below) for x in (-half, half - leg) for y0, y1 in ends]
    if draws.chance(0.3):  # drawers
        boxes.append((half - 42, half - leg, front + 5, BACK_Y - 3, draws.number(0, 8), below))
    if draws.chance(0.4):  # a screen or books
        left = draws.number(-half, half - 26)
        back = draws.number(front + 15, BACK_Y)
        boxes.append((left, left + 25, back - draws.number(4, 14), back, height, height + draws.number(5, 40)))
    return boxes


def _sofa(draws: RandomDraws) -> list[Box]:
    """A sofa or armchair or, without arms, a bench with a back."""
    half, seat, arm = draws.number(30, HALF_WIDTH), draws.number(38, 50), draws.number(8, 20)
    front, thick = BACK_Y - draws.number(55, 100), draws.number(8, 25)
    boxes = [(-half, half, front, BACK_Y, draws.pick((0, 8)), seat)]
    boxes.append((-half, half, BACK_Y - thick, BACK_Y, seat, seat + draws.number(20, 55)))
    if draws.chance(0.7):
        rest = seat + draws.number(10, 25)
        boxes += [(-half, arm - half, front, BACK_Y, 8, rest), (half - arm, half, front, BACK_Y, 8, rest)]
    return boxes


def _bed(draws: RandomDraws) -> list[Box]:
    """A bed or stretcher, with or without a headboard."""
    front, top, legs = BACK_Y - draws.number(70, 110), draws.number(40, 65), draws.number(0, 25)
    boxes = [(-HALF_WIDTH, HALF_WIDTH, front, BACK_Y, legs, top)]
    if legs:
        boxes += [(x, x + 6, y, y + 6, 0, legs) for x in (-HALF_WIDTH, HALF_WIDTH - 6) for y in (front, BACK_Y - 6)]
    boxes += [(-HALF_WIDTH, 4 - HALF_WIDTH, front, BACK_Y, top, top + draws.number(15, 50))] * draws.number(0, 1)
    return [*boxes, (HALF_WIDTH - 40, HALF_WIDTH - 8, front + 10, BACK_Y - 10, top, top + draws.number(6, 14))]


def _stairs(draws: RandomDraws) -> list[Box]:
    """Solid or open stairs that rise towards the back, with steps too high for the robot to climb."""
    half, steps, rise = draws.number(35, HALF_WIDTH), draws.number(3, 5), draws.number(14, 22)
    tread, solid = 110 // steps, draws.chance(0.6)
    fronts = [BACK_Y - (steps - step) * tread for step in range(steps)]
    return [
        (-half, half, front, BACK_Y if solid else front + tread, 0 if solid else (n + 1) * rise - 4, (n + 1) * rise)
        for n, front in enumerate(fronts)
    ]


FURNITURE: tuple[Callable[[RandomDraws], list[Box]], ...] = (
    *(_cupboard,) * 5, _shelf, _shelf, _wall_shelf, *(_table,) * 4, _sofa, _bed, _stairs,
)  # fmt: skip
FREESTANDING = (_table, _table, _sofa, _bed, _shelf, _cupboard)
"""Kinds of furniture for tiles without a wall behind them."""
