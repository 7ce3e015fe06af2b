"""Draws the obstacles and the clutter of a random arena."""

from sarsim.arenas.layout import SIDES, YAW, Item, Layout, Side, Tile, opposite, shift
from sarsim.arenas.random_draws import RandomDraws

DIAGONALS = ("wall_diag_120", "corner_diag_120")
OBSTACLES: dict[int, tuple[str, ...]] = {
    0: DIAGONALS,
    1: DIAGONALS,
    2: (*DIAGONALS, "barrel", "elevated_ramps", "elevated_ramps"),
    3: (*DIAGONALS, "barrel", "elevated_ramps", "stepfield_red_diagonal", "stepfield_red_diagonal"),
}
"""Elements that may take a whole tile, by difficulty; one that is listed twice is drawn more often."""
BESIDE_WALLS = (("wooden_block", 53), ("pvc_pipe", 56))
"""Elements that lie along walls, and their distance from the tile's centre, cm: a metre of the lane stays free."""


def place_obstacles(layout: Layout, draws: RandomDraws, share: float, difficulty: int) -> list[Item]:
    """Obstacles that take a whole tile each, until they have their share or no further tile can be blocked."""
    wanted = round(share * len(layout.tiles()))
    items: list[Item] = []
    for tile in draws.shuffled(layout.tiles()):
        side = draws.pick(SIDES)
        fitting = [k for k in draws.shuffled(OBSTACLES[difficulty]) if _leaves_no_pocket(layout, tile, k, side)]
        if len(items) < wanted and fitting and layout.block([tile]):
            items.append(Item(tile, fitting[0], YAW[side]))
    return items


def _leaves_no_pocket(layout: Layout, tile: Tile, kind: str, side: Side) -> bool:
    """Whether the floor beside a diagonal wall is open to a neighbouring tile."""
    open_sides = {s for _, s in layout.views([tile])}
    if kind == "wall_diag_120":
        halves = ({1, 2}, {0, 3}) if side % 2 else ({0, 1}, {2, 3})
        return all(open_sides & half for half in halves)
    return kind != "corner_diag_120" or opposite(side) in open_sides


def scatter_clutter(layout: Layout, draws: RandomDraws, share: float) -> list[Item]:
    """Blocks and pipes along the walls of a share of the tiles."""
    tiles = [t for t in layout.tiles() if layout.is_free(t) and layout.walls_of(t)]
    wanted = round(share * len(layout.tiles()))
    items = []
    for tile in draws.shuffled(tiles)[:wanted]:
        side = draws.pick(layout.walls_of(tile))
        kind, out = draws.pick(BESIDE_WALLS)
        items.append(Item(tile, kind, 90 * side, shift(side, out, draws.number(-35, 35))))
    return items
