"""Settings of an arena, kept in a separate module so that ``--help`` starts fast."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Fixed

from sarsim.flags import Given

StartPose = tuple[float, float, float]  # x and y in m, yaw in degrees
FRACTION_SETTINGS = ("wall_density", "ramps", "clutter", "furniture", "bulky", "furnished")
"""Settings of random arenas that are fractions of walls or tiles."""


@dataclass(frozen=True)
class WorldVictims:
    """Victims in a third-party world.

    Attributes:
        placements: list of victims and starts that a league publishes with its world; ``--start`` takes precedence.
        state: state of victims whose names do not say whether they are alive.
    """

    placements: Path | None = None
    state: Literal["alive", "dead"] = "dead"


@dataclass(frozen=True)
class RandomArenaConfig:
    """Contents of a random arena.

    Attributes:
        columns: number of 1.2 m tiles along x, 3 to 20.
        rows: number of 1.2 m tiles along y, 3 to 20.
        wall_density: fraction of a perfect maze's inner walls that are built; 0 is an empty hall.
        ramps: fraction of the tiles with ramps or decks, 0 to 1; no effect at difficulty 0.
        clutter: fraction of the tiles with an obstacle, 0 to 1: diagonal walls, from difficulty 2 also barrels and
            crossing ramps, and at difficulty 3 also step fields. From difficulty 2, as many other tiles have blocks
            or pipes.
        furniture: fraction of the tiles with furniture or rescue elements that block the robot, 0 to 1. If above 0,
            as many tiles have an object on a wall, and some inner walls are thick or made of cloth.
        bulky: fraction of the tiles with elements that block the view: raised floors, steep boards, cupboards.
        victims: number of victims, 0 to 100.
        difficulty: 0 is flat; 1 adds decks and ridges of ramps; 2 adds crossing ramps, clutter, holes in walls and
            half-hidden victims; 3 adds continuous ramp fields and step fields. By default the seed modulo 4.
        ceiling: add a ceiling at a height of 2.4 m and extend all walls up to it.
        furnished: fraction of the tiles with furniture of varied size and colour in rows along walls: lockers,
            shelves, tables, sofas, beds, stairs.
        painted: random colours and patterns on floor, walls, ramps and boards.
        things: maximum number of objects to find other than people, 0 to 100: in turn hazmat signs, codes, dolls,
            tags, fire extinguishers and door levers. If above 0, about a third of the people are dead.
    """

    columns: int = 7
    rows: int = 6
    wall_density: Fixed[float] = 0.5
    ramps: float = 0.25
    clutter: float = 0.15
    victims: int = 3
    difficulty: Given[int] = None
    ceiling: bool = False
    furniture: float = 0.0
    bulky: Fixed[float] = 0.0
    furnished: Fixed[float] = 0.0
    painted: Fixed[bool] = False
    things: Fixed[int] = 0
