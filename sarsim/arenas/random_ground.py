"""Generates the layout of a random arena: a maze with ramps and decks."""

from collections.abc import Sequence

from sarsim.arenas.layout import FLOOR, SIDES, YAW, Item, Layout, Side, Tile, TileGround, opposite, shift
from sarsim.arenas.random_draws import RandomDraws

DECK_HEIGHTS = (17, 25, 34)  # cm, heights of decks and of the ramps up to them; 25 means 25.5
RIDGE_HEIGHT = 17  # cm, height of ridges
FENCE_PROBABILITY = 0.5  # Probability of a wall on a side with a drop to floor
HOLES_PROBABILITY = 0.15  # Probability that an inner wall has holes, if the arena has such walls
TALL_WALL_PROBABILITY = 0.25  # Probability that any other wall is twice as high
OTHER_WALL_PROBABILITY = 0.25  # Probability that an inner wall is not a panel, if the arena has such walls
MAX_CORRIDOR_LENGTH = 4  # tiles; a longer row of open floor ahead counts as this long when starts are compared


def make_maze(layout: Layout, draws: RandomDraws, density: float) -> None:
    """Make a perfect maze by depth-first search, then keep each inner wall with probability ``density``."""
    layout.walls.update(layout.inner_edges())
    path = [draws.pick(layout.tiles())]
    seen = set(path)
    while path:
        ways = [s for s in SIDES if (t := layout.neighbour(path[-1], s)) is not None and t not in seen]
        if not ways:
            path.pop()
            continue
        side = draws.pick(ways)
        layout.walls.discard(layout.edge(path[-1], side))
        path.append(layout.next(path[-1], side))
        seen.add(path[-1])
    for edge in sorted(layout.walls):
        if not draws.chance(density):
            layout.walls.discard(edge)


def lay_ramps(layout: Layout, draws: RandomDraws, fraction: float, fields: bool) -> None:
    """Lay runs of ramps and decks until they fill a ``fraction`` of the tiles or all attempts are used up.

    If ``fields`` is set, also lay fields of several ridges in a row; the first run is such a field.
    """
    tries, left = 10 * len(layout.tiles()), round(fraction * len(layout.tiles()))
    for _ in range(tries if fields else 0):
        if taken := _lay_run(layout, draws, "field", left):
            left -= taken
            break
    kinds = ["ridge", "over", "over", "up"] + ["field", "field"] * fields
    for _ in range(2 * tries):
        if left <= 0:
            break
        left -= _lay_run(layout, draws, draws.pick(kinds), left)


def _lay_run(layout: Layout, draws: RandomDraws, kind: str, max_tiles: int) -> int:
    """Try to lay a run from a random tile in a random direction; return the number of tiles that the run occupies."""
    first, side = draws.pick(layout.tiles()), draws.pick(SIDES)
    grounds, beyond = _draw_run(draws, kind, side), 0 if kind == "up" else 1
    tiles = layout.tiles_towards(first, side, 1 + len(grounds) + beyond)
    inner, ends = tiles[1 : 1 + len(grounds)], [first, *tiles[1 + len(grounds) :]]
    fits = len(inner) == len(grounds) <= max_tiles and len(ends) == 1 + beyond
    if not fits or not all(map(layout.is_free, inner)) or any(layout.ground(t) != FLOOR for t in ends):
        return 0
    opened = [layout.edge(tile, side) for tile in tiles[:-1]]
    if not layout.try_lay(zip(inner, grounds, strict=True), opened):
        return 0
    layout.reserved.update(tiles)
    _fence(layout, draws, inner)
    return len(inner)


def _draw_run(draws: RandomDraws, kind: str, side: Side) -> list[TileGround]:
    """Grounds of a run: a ridge, several ridges, two ramps with decks between them, or a ramp up to decks."""
    level = draws.pick(DECK_HEIGHTS)
    up, down = TileGround("ramp", level, side), TileGround("ramp", level, opposite(side))
    decks = [TileGround("deck", level)] * draws.number(1, 2)
    ridges = [TileGround("ridge", RIDGE_HEIGHT, side)] * draws.number(2, 4)
    return {"ridge": ridges[:1], "field": ridges, "over": [up, *decks, down], "up": [up, *decks]}[kind]


def _fence(layout: Layout, draws: RandomDraws, tiles: list[Tile]) -> None:
    """Put walls on all sides with a drop, except that a drop to floor gets one only with ``FENCE_PROBABILITY``."""
    for tile in tiles:
        for side in SIDES:
            falls = not layout.has_wall(tile, side) and not layout.is_passable(tile, side)
            if falls and (layout.ground(layout.next(tile, side)) != FLOOR or draws.chance(FENCE_PROBABILITY)):
                layout.walls.add(layout.edge(tile, side))


def choose_start(layout: Layout, draws: RandomDraws) -> tuple[Tile, Side]:
    """Choose the floor tile and side with the longest row of open floor; reserve the first two tiles of the row."""
    places = [(t, s) for t in layout.tiles() if layout.ground(t) == FLOOR for s in SIDES]
    tile, side = max(draws.shuffled(places), key=lambda place: len(_corridor(layout, *place)))
    layout.start = tile
    layout.reserved.update(_corridor(layout, tile, side)[:2])
    return tile, side


def _corridor(layout: Layout, tile: Tile, side: Side) -> list[Tile]:
    """The row of at most ``MAX_CORRIDOR_LENGTH`` open floor tiles that starts at a tile and leads towards a side."""
    corridor = [tile]
    while len(corridor) < MAX_CORRIDOR_LENGTH and layout.is_passable(corridor[-1], side):
        after = layout.next(corridor[-1], side)
        if layout.ground(after) != FLOOR:
            break
        corridor.append(after)
    return corridor


def ground_items(layout: Layout) -> list[Item]:
    """The library elements of all ramps, ridges and decks."""
    items = []
    for tile in layout.tiles():
        ground = layout.ground(tile)
        if ground.kind == "deck":
            items.append(Item(tile, f"deck_{ground.level}"))
        elif ground.kind == "ramp":
            items.append(Item(tile, f"ramp_{ground.level}", YAW[opposite(ground.uphill)]))
        elif ground.kind == "ridge":
            # Two ramps, shifted so that their upper ends meet at the tile's centre.
            ends = (opposite(ground.uphill), ground.uphill)
            items += [Item(tile, f"ramp_{RIDGE_HEIGHT}", YAW[end], shift(end, 60, 0)) for end in ends]
    return items


def wall_items(layout: Layout, draws: RandomDraws, holes: bool, tall: bool, others: Sequence[str] = ()) -> list[Item]:
    """The library elements of all walls.

    Args:
        layout: the plan.
        draws: random draws.
        holes: whether some inner walls have holes.
        tall: whether all panels reach the ceiling.
        others: elements that replace some of the inner walls.
    """
    items = []
    for tile in layout.tiles():
        for side in SIDES:
            if layout.has_wall(tile, side) and layout.edge(tile, side) == (tile, side):
                inner = layout.neighbour(tile, side) is not None
                if inner and others and draws.chance(OTHER_WALL_PROBABILITY):
                    kind = draws.pick(others)
                else:
                    kind = _draw_wall(draws, holes and inner, tall)
                items.append(Item(tile, kind, YAW[side]))
    return items


def _draw_wall(draws: RandomDraws, holes: bool, tall: bool) -> str:
    if tall:
        return "tall_wall"
    if holes and draws.chance(HOLES_PROBABILITY):
        return draws.pick(["wall_holes1", "small_wall_triple_holes"])
    return "tall_wall" if draws.chance(TALL_WALL_PROBABILITY) else "small_wall"
