"""Settings of an arena, in a module of their own, because ``--help`` needs no more than these."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Fixed

StartPose = tuple[float, float, float]  # x and y in m, yaw in degrees
SHARES = ("wall_density", "ramps", "clutter", "furniture", "bulky", "furnished")
"""Settings of random arenas that are shares of walls or tiles."""


@dataclass(frozen=True)
class WorldVictims:
    """Victims of a world that others made.

    Attributes:
        placements: list of victims, and of starts if none is given, which a league publishes beside its world.
        state: of victims whose name does not say whether they are alive.
    """

    placements: Path | None = None
    state: Literal["alive", "dead"] = "dead"


@dataclass(frozen=True)
class RandomArenaConfig:
    """Contents of a random arena.

    Attributes:
        columns: tiles of 1.2 m along x, 3 to 20.
        rows: tiles along y, 3 to 20.
        wall_density: share of the inner walls of a perfect maze that stand; 0 is a hall.
        ramps: share of the tiles that are ramps and decks, from difficulty 1 on.
        clutter: share of the tiles with an obstacle: a diagonal wall, from difficulty 2 also a barrel or crossing
            ramps, at 3 also a step field; from 2 on, as many tiles have a block or a pipe beside a wall.
        furniture: share of the tiles with furniture or rescue elements that block the robot; as many tiles have an
            object on a wall, and some inner walls are thick or veils.
        bulky: share of the tiles with elements that hide much: raised floors to drive under, steep boards, cupboards.
        victims: number of victims, 0 to 100.
        difficulty: 0 flat; 1 decks and ridges of ramps; 2 crossing ramps, clutter, holes in walls and half-hidden
            victims; 3 continuous ramp fields and step fields; by default the seed modulo 4.
        ceiling: ceiling at a height of 2.4 m, with all walls up to it.
        furnished: share of the tiles with furniture of all sizes and colours, in rows along walls: lockers, shelves,
            tables, sofas, beds, stairs.
        painted: random colours and patterns on floor, walls, ramps and boards.
        things: number of things to find besides people, 0 to 100: in turn hazmat signs, codes, dolls, tags, fire
            extinguishers and levers on walls, as many as fit; with any, a third of the people is dead.
    """

    columns: int = 7
    rows: int = 6
    wall_density: Fixed[float] = 0.5
    ramps: float = 0.25
    clutter: float = 0.15
    victims: int = 3
    difficulty: int | None = None
    ceiling: bool = False
    furniture: float = 0.0
    bulky: Fixed[float] = 0.0
    furnished: Fixed[float] = 0.0
    painted: Fixed[bool] = False
    things: Fixed[int] = 0
