"""Places the victims of a random arena next to the tiles on which the robot drives."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Place
from sarsim.arenas.elements import TILE_SIZE
from sarsim.arenas.layout import NEIGHBOUR_OFFSETS, SIDES, Layout, Side, Tile, opposite
from sarsim.arenas.random_draws import RandomDraws
from sarsim.victims.victims import PLACEMENTS, SUITABLE_POSTURES, Placement, Posture, VictimModel, make_victim

EDGE_MARGIN = 0.04  # m between a victim and the edges of its tiles
MAX_DRAWS = 10  # Maximum number of random people that are tried until one fits
OPEN_POSTURES: tuple[Posture, ...] = ("lying", "prone", "side", "sitting", "sitting", "slumped", "seated")
"""Postures to choose from for the placement "open"; for the other placements, see ``SUITABLE_POSTURES``."""


@dataclass(frozen=True, eq=False)
class PlacedVictim:
    """A victim, and its pose in the arena.

    Attributes:
        model: the victim.
        position: (3,) m, origin of the victim relative to the outer corner of tile (0, 0).
        yaw: rotation of the victim to the left, rad.
    """

    model: VictimModel
    position: NDArray[np.float64]
    yaw: float


@dataclass(frozen=True, eq=False)
class _Spot:
    """A rectangle of tiles, and the side that a victim on it faces."""

    tiles: list[Tile]
    facing: Side

    @property
    def back(self) -> Tile:
        """The rearmost tile, behind the victim."""
        return min(self.tiles, key=lambda tile: int(np.dot(tile, NEIGHBOUR_OFFSETS[self.facing])))

    @property
    def room(self) -> NDArray[np.float64]:
        """(2,) m, size of the rectangle along the direction that the victim faces, and across this direction."""
        count = np.ptp(self.tiles, axis=0) + 1
        return count[[0, 1] if self.facing % 2 == 0 else [1, 0]] * TILE_SIZE


def place_victim(layout: Layout, draws: RandomDraws, name: str, hidden: bool) -> PlacedVictim | None:
    """Generate random people until one fits on free tiles, and block these tiles; None if nobody fits.

    If ``hidden`` is set, the person may be half buried in rubble, in a box or behind a hole.
    """
    spots = _spots(layout)
    for _ in range(MAX_DRAWS if spots else 0):
        placement: Placement = draws.pick(PLACEMENTS) if hidden else draws.pick(("open",))
        posture = draws.pick(OPEN_POSTURES if placement == "open" else SUITABLE_POSTURES[placement])
        model = make_victim(name, draws.rng, posture, placement)
        for spot in draws.shuffled(spots):
            if _fits(layout, model, spot) and layout.try_block(spot.tiles):
                layout.reserved.update(layout.next(*view) for view in layout.viewing_sides(spot.tiles))
                return PlacedVictim(model, _position(model, spot), spot.facing * np.pi / 2)
    return None


def _spots(layout: Layout) -> list[_Spot]:
    """Free rectangles of at most two by two tiles, each listed once for every side that a victim may face."""
    sizes = [(w, h) for w in (1, 2) for h in (1, 2)]
    rectangles = [[(i + a, j + b) for a in range(w) for b in range(h)] for i, j in layout.tiles() for w, h in sizes]
    inside = set(layout.tiles())
    free = [tiles for tiles in rectangles if inside.issuperset(tiles) and all(map(layout.is_free, tiles))]
    return [_Spot(tiles, side) for tiles in free for side in SIDES]


def _fits(layout: Layout, victim: VictimModel, spot: _Spot) -> bool:
    """Whether the victim has room, a wall if needed and, for a victim in a box or behind a hole, open floor ahead."""
    # A panel with a hole may fill its tile from wall to wall.
    margin = 0.0 if victim.placement == "hole" else EDGE_MARGIN
    if (victim.footprint[1] - victim.footprint[0] > spot.room - 2 * margin + 1e-6).any():
        return False
    views = layout.viewing_sides(spot.tiles)
    looks_out = any((tile, spot.facing) in views for tile in spot.tiles)
    leans = spot.room[1] == TILE_SIZE and layout.has_wall(spot.back, opposite(spot.facing))
    return (looks_out or victim.placement not in ("box", "hole")) and (leans or not victim.needs_wall)


def _position(victim: VictimModel, spot: _Spot) -> Place:
    """(3,) m, the victim's origin: at the foot of a wall if needed, else with the footprint centred on the tiles."""
    forward, left = np.array(NEIGHBOUR_OFFSETS[spot.facing]), np.array(NEIGHBOUR_OFFSETS[(spot.facing + 1) % 4])
    if victim.needs_wall:
        # 6 mm is half the wall's thickness plus a clearance of 1 mm.
        xy = (np.array(spot.back) + 0.5) * TILE_SIZE - (TILE_SIZE / 2 - 0.006) * forward
    else:
        ahead, aside = victim.footprint.mean(axis=0)
        xy = (np.mean(spot.tiles, axis=0) + 0.5) * TILE_SIZE - ahead * forward - aside * left
    return np.array([*xy, 0.0])
