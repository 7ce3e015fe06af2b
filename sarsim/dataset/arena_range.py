"""What the random arenas of a dataset are like; apart from the recipe, for ``--help`` needs no more than this."""

import math
from dataclasses import dataclass

import numpy as np
from tyro.conf import Fixed

from pipeline.errors import InputError
from sarsim.arenas.settings import RandomArenaConfig


@dataclass(frozen=True)
class ArenaRange:
    """Random arenas are drawn evenly between these values, ends included.

    Attributes:
        tiles: tiles of 1.2 m along x and along y; large arenas show long views.
        wall_density: share of a maze's inner walls that stand; 0 is a hall.
        ramps: share of the tiles that are ramps and decks; the thesis's classes 3 and 4 stand on these.
        clutter: share of the tiles with a barrel, a block, a step field or such; more of it hides more.
        furniture: share of the tiles with furniture; teaches a network that it is neither wall nor victim.
        bulky: share of the tiles with raised floors, steep boards and cupboards, which hide much.
        furnished: share of the tiles with furniture of all sizes and colours, such as lockers and tables; teaches a
            network what is neither wall nor deck.
        victims: victims in an arena.
        difficulty: 0 flat, 1 decks and ridges, 2 crossing ramps and half-hidden victims, 3 ramp and step fields.
        ceilings: share of the arenas that have one.
        painted: share of the arenas with colours and patterns of their own, so that colour tells a network less.
    """

    tiles: tuple[int, int] = (4, 8)
    wall_density: Fixed[tuple[float, float]] = (0.2, 0.7)
    ramps: tuple[float, float] = (0.2, 0.5)
    clutter: Fixed[tuple[float, float]] = (0.05, 0.2)
    victims: tuple[int, int] = (1, 4)
    difficulty: tuple[int, int] = (0, 3)
    ceilings: Fixed[float] = 0.2
    furniture: tuple[float, float] = (0.0, 0.0)
    bulky: Fixed[tuple[float, float]] = (0.0, 0.0)
    furnished: tuple[float, float] = (0.0, 0.0)
    painted: float = 0.0

    def __post_init__(self) -> None:
        shares = ("wall_density", "ramps", "clutter", "furniture", "bulky", "furnished")
        for name in ("tiles", *shares, "victims", "difficulty"):
            check_order(f"random.{name}", getattr(self, name))
        check("random.ceilings", self.ceilings, 0, 1)
        check("random.painted", self.painted, 0, 1)

    def draw(self, rng: np.random.Generator) -> RandomArenaConfig:
        """One of these arenas."""
        return RandomArenaConfig(
            columns=int(rng.integers(*self.tiles, endpoint=True)),
            rows=int(rng.integers(*self.tiles, endpoint=True)),
            wall_density=round(rng.uniform(*self.wall_density), 3),
            ramps=round(rng.uniform(*self.ramps), 3),
            clutter=round(rng.uniform(*self.clutter), 3),
            victims=int(rng.integers(*self.victims, endpoint=True)),
            difficulty=int(rng.integers(*self.difficulty, endpoint=True)),
            ceiling=bool(rng.random() < self.ceilings),
            # No number is drawn for nothing: datasets without furniture or paint stay as they are.
            furniture=round(rng.uniform(*self.furniture), 3) if self.furniture[1] else 0.0,
            bulky=round(rng.uniform(*self.bulky), 3) if self.bulky[1] else 0.0,
            furnished=round(rng.uniform(*self.furnished), 3) if self.furnished[1] else 0.0,
            painted=bool(self.painted and rng.random() < self.painted),
        )


def check_order(flag: str, bounds: tuple[float, float]) -> None:
    """Raises InputError where bounds are not in order."""
    if not bounds[0] <= bounds[1]:
        raise InputError(f"--{flag} {bounds[0]} {bounds[1]}: the lower value comes first")


def check(flag: str, value: float, low: float, high: float = math.inf) -> None:
    """Raises InputError where a flag's value is not between two bounds."""
    if not low <= value <= high:
        limits = f"at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"
        raise InputError(f"--{flag} {value:g}: {limits}")
