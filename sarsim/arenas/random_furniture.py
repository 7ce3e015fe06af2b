"""Places the obstacles, clutter, furniture and rescue elements of a random arena.

The robot cannot drive over these elements, which are easily mistaken for elements of other classes.
"""

from sarsim.arenas.layout import SIDES, YAW, Item, Layout, Side, Tile, opposite, shift
from sarsim.arenas.random_draws import RandomDraws

DIAGONALS = ("wall_diag_120", "corner_diag_120")
OBSTACLES: dict[int, tuple[str, ...]] = {
    0: DIAGONALS,
    1: DIAGONALS,
    2: (*DIAGONALS, "barrel", "elevated_ramps", "elevated_ramps"),
    3: (*DIAGONALS, "barrel", "elevated_ramps", "stepfield_red_diagonal", "stepfield_red_diagonal"),
}
"""Elements that occupy a whole tile, by difficulty; elements listed twice are chosen twice as often."""
BESIDE_WALLS = (("wooden_block", 53), ("pvc_pipe", 56))
"""Elements that lie along walls, each with a distance from the tile's centre, cm, that keeps a lane of 1 m free."""
AGAINST_WALL = (
    ("cabinet_low", 14), ("cabinet_tall", 14), ("cabinet_narrow", 34), ("bookshelf", 9), ("desk", 4), ("seat", 19),
    ("crate", 29), ("column", 39), ("motor", 8), ("gas_bottles", 34), ("pipes", 4), ("sacks", 2), ("sacks", 2),
    ("simple_elev_ramp", 0), ("simple_elev_ramp", 0), ("stairs_120", 0), ("manip_storage", 0),
)  # fmt: skip
"""Elements that stand with the back to a side of the tile, each with its maximum shift along this side, cm."""
FREESTANDING = ("raised_floor", "raised_floor", "raised_floor", "elevated_ramps", "crate_stack", "work_table")
"""Elements for the centre of a tile."""
RAMPS = (("half_ramp", 0), ("half_ramp", 0), ("half_ramp_shifted", 2), ("full_ramp", 2), ("full_ramp", 2))
"""Ramps that lead nowhere, each with the number of quarter turns after which it rises away from the robot."""
BULKY = (
    *("raised_floor_120",) * 4, *("simple_elev_ramp",) * 3, "wardrobe", "wardrobe", "cupboards", "machine",
    "cabinet_tall",
)  # fmt: skip
"""Elements that block much of the view. The robot can drive under the first kind, which may span several tiles."""
RAISED_FLOOR_PROBABILITY = 0.5  # Fraction of a raised floor's free neighbouring tiles that also get a raised floor
CHAIRS = ("chair", "office_chair", "lab_chair")  # Chairs at desks
SMALL_ELEMENTS = ("chair", "chair", "crate_small", "fire_extinguisher", "bag")
"""Small elements that may stand in front of another element, at any angle."""
SMALL_ELEMENT_PROBABILITY = 0.4  # Fraction of the furnished tiles without a workplace that also get a small element
ON_WALLS = ("fiducial_barrel", "red_barrel", "box_low", "box_middle", "box_high", "hazmat", "start_check")
"""Elements that hang on walls."""
OTHER_WALLS = ("partition", "partition", "veil_wall")  # Inner walls other than panels


def place_obstacles(layout: Layout, draws: RandomDraws, fraction: float, difficulty: int) -> list[Item]:
    """Block a ``fraction`` of the tiles with one obstacle each, or fewer if no further tile can be blocked."""
    wanted = round(fraction * len(layout.tiles()))
    items: list[Item] = []
    for tile in draws.shuffled(layout.tiles()):
        side = draws.pick(SIDES)
        fitting = [k for k in draws.shuffled(OBSTACLES[difficulty]) if _leaves_no_pocket(layout, tile, k, side)]
        if len(items) < wanted and fitting and layout.try_block([tile]):
            items.append(Item(tile, fitting[0], YAW[side]))
    return items


def _leaves_no_pocket(layout: Layout, tile: Tile, kind: str, side: Side) -> bool:
    """Whether an element leaves no part of the tile's floor enclosed; only a diagonal wall can enclose floor."""
    open_sides = {s for _, s in layout.viewing_sides([tile])}
    if kind == "wall_diag_120":
        halves = ({1, 2}, {0, 3}) if side % 2 else ({0, 1}, {2, 3})
        return all(open_sides & half for half in halves)
    return kind != "corner_diag_120" or opposite(side) in open_sides


def scatter_clutter(layout: Layout, draws: RandomDraws, fraction: float) -> list[Item]:
    """Place blocks and pipes along walls on a ``fraction`` of the tiles."""
    tiles = [t for t in layout.tiles() if layout.is_free(t) and layout.walls_of(t)]
    wanted = round(fraction * len(layout.tiles()))
    items = []
    for tile in draws.shuffled(tiles)[:wanted]:
        side = draws.pick(layout.walls_of(tile))
        kind, out = draws.pick(BESIDE_WALLS)
        items.append(Item(tile, kind, 90 * side, shift(side, out, draws.number(-35, 35))))
    return items


def place_furniture(layout: Layout, draws: RandomDraws, fraction: float) -> list[Item]:
    """Block a ``fraction`` of the tiles with furniture, or fewer if no further tile can be blocked."""
    wanted = round(fraction * len(layout.tiles()))
    items: list[Item] = []
    blocked = 0
    for tile in draws.shuffled(layout.tiles()):
        views = layout.viewing_sides([tile])
        if blocked < wanted and layout.is_free(tile) and views and layout.try_block([tile]):
            items += _furnish(draws, tile, draws.pick(views)[1])
            blocked += 1
    return items


def place_bulky(layout: Layout, draws: RandomDraws, fraction: float) -> list[Item]:
    """Cover a ``fraction`` of the tiles with raised floors, which leave the tiles free, or with blocking elements."""
    wanted = round(fraction * len(layout.tiles()))
    items: dict[Tile, Item] = {}
    for tile in draws.shuffled(layout.tiles()):
        kind = draws.pick(BULKY)
        if len(items) >= wanted or tile in items or not layout.is_free(tile):
            continue
        if kind == BULKY[0]:
            items |= {under: Item(under, kind) for under in _under_a_floor(layout, draws, tile)}
        elif (views := layout.viewing_sides([tile])) and layout.try_block([tile]):
            back = opposite(draws.pick(views)[1])
            turn = draws.number(0, 3) if kind == "simple_elev_ramp" else 0
            items[tile] = Item(tile, kind, YAW[(back + turn) % 4])
    return list(items.values())


def _under_a_floor(layout: Layout, draws: RandomDraws, tile: Tile) -> list[Tile]:
    """``tile``, and a random selection of the free neighbouring tiles to which the robot can drive from ``tile``."""
    beside = [layout.next(tile, side) for side in layout.exits(tile)]
    return [tile, *(t for t in beside if layout.is_free(t) and draws.chance(RAISED_FLOOR_PROBABILITY))]


def hang_on_walls(layout: Layout, draws: RandomDraws, fraction: float) -> list[Item]:
    """Hang barrels, boxes and signs in tiles with only one wall; a lane between two walls would become too narrow."""
    places = [(t, layout.walls_of(t)) for t in layout.tiles() if layout.is_free(t)]
    single = [(tile, walls[0]) for tile, walls in places if len(walls) == 1]
    wanted = round(fraction * len(layout.tiles()))
    return [Item(tile, draws.pick(ON_WALLS), YAW[side]) for tile, side in draws.shuffled(single)[:wanted]]


def _furnish(draws: RandomDraws, tile: Tile, front: Side) -> list[Item]:
    """Random furniture for a tile that the robot sees through the tile's side ``front``."""
    back = opposite(front)
    draw = draws.pick(("middle", "middle", "ramp", *("back",) * 5, *("work",) * 3))
    if draw == "work":
        return _workplace(draws, tile, front)
    if draw == "middle":
        items = [Item(tile, draws.pick(FREESTANDING), YAW[back])]
    elif draw == "ramp":
        kind, turn = draws.pick(RAMPS)
        items = [Item(tile, kind, YAW[(back + turn) % 4])]
    else:
        kind, room = draws.pick(AGAINST_WALL)
        items = [Item(tile, kind, YAW[back], shift(front, 0, draws.number(-room, room)))]
    if draws.chance(SMALL_ELEMENT_PROBABILITY):
        place = shift(front, draws.number(20, 35), draws.number(-30, 30))
        items.append(Item(tile, draws.pick(SMALL_ELEMENTS), draws.number(0, 359), place))
    return items


def _workplace(draws: RandomDraws, tile: Tile, front: Side) -> list[Item]:
    """A desk with one or two chairs under it or in front of it."""
    sides = (-1, 1) if draws.chance(0.5) else (draws.pick((-1, 1)),)
    places = [shift(front, draws.number(0, 20), side * draws.number(20, 28)) for side in sides]
    chairs = [Item(tile, draws.pick(CHAIRS), draws.number(0, 359), place) for place in places]
    return [Item(tile, "desk", YAW[opposite(front)]), *chairs]
