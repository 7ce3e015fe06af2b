"""Settings of a dataset, kept in a separate module so that ``--help`` starts fast."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from tyro.conf import Fixed

from pipeline.errors import InputError
from sarsim.arenas.settings import FRACTION_SETTINGS, RandomArenaConfig
from sarsim.flags import Given

RANDOM = "random"  # Name that stands for a new random arena in each scene
KEYFRAME_SPACING = (0.3, 0.6)  # m driven or rad turned from one keyframe to the next
MIN_IMAGE_SIDE = 16  # Minimum width and height of an image, pixels


@dataclass(frozen=True)
class ArenaRange:
    """Inclusive ranges from which random arenas are drawn uniformly; the defaults resemble the thesis's arenas.

    Attributes:
        tiles: number of tiles of 1.2 m along x and along y; large arenas give long views.
        wall_density: fraction of a maze's inner walls that are built; 0 is an empty hall.
        ramps: fraction of the tiles with ramps and decks (labels 3 and 4).
        clutter: fraction of the tiles with obstacles such as barrels, blocks and step fields.
        furniture: fraction of the tiles with furniture, to teach a network objects that are neither wall nor victim.
        bulky: fraction of the tiles with raised floors, steep boards and cupboards, which block the view.
        furnished: fraction of the tiles with furniture of varied size and colour, such as lockers and tables, to
            teach a network objects that are neither wall nor deck.
        victims: number of victims in an arena.
        difficulty: 0 flat, 1 decks and ridges, 2 crossing ramps and half-hidden victims, 3 ramp and step fields.
        ceilings: fraction of the arenas with a ceiling.
        painted: fraction of the arenas with random colours and patterns, so that networks rely less on colour.
        things: number of objects to find besides people, such as fire extinguishers and door levers.
    """

    tiles: tuple[int, int] = (4, 8)
    wall_density: Fixed[tuple[float, float]] = (0.2, 0.7)
    ramps: tuple[float, float] = (0.3, 0.6)
    clutter: Fixed[tuple[float, float]] = (0.0, 0.0)
    victims: tuple[int, int] = (1, 4)
    difficulty: tuple[int, int] = (1, 2)
    ceilings: Fixed[float] = 0.0
    furniture: tuple[float, float] = (0.0, 0.0)
    bulky: Fixed[tuple[float, float]] = (0.0, 0.0)
    furnished: tuple[float, float] = (0.0, 0.0)
    painted: float = 0.0
    things: Fixed[tuple[int, int]] = (0, 0)

    def __post_init__(self) -> None:
        for name in ("tiles", *FRACTION_SETTINGS, "victims", "difficulty", "things"):
            check_order(f"random.{name}", getattr(self, name))
        check_range("random.ceilings", self.ceilings, 0, 1)
        check_range("random.painted", self.painted, 0, 1)

    def draw(self, rng: np.random.Generator) -> RandomArenaConfig:
        """Settings of one arena, drawn from these ranges."""
        return RandomArenaConfig(
            columns=int(rng.integers(*self.tiles, endpoint=True)),
            rows=int(rng.integers(*self.tiles, endpoint=True)),
            wall_density=round(rng.uniform(*self.wall_density), 3),
            ramps=round(rng.uniform(*self.ramps), 3),
            clutter=round(rng.uniform(*self.clutter), 3),
            victims=int(rng.integers(*self.victims, endpoint=True)),
            difficulty=int(rng.integers(*self.difficulty, endpoint=True)),
            ceiling=bool(rng.random() < self.ceilings),
            # Numbers are drawn only if used, so that datasets without furniture, paint or things stay the same.
            furniture=round(rng.uniform(*self.furniture), 3) if self.furniture[1] else 0.0,
            bulky=round(rng.uniform(*self.bulky), 3) if self.bulky[1] else 0.0,
            furnished=round(rng.uniform(*self.furnished), 3) if self.furnished[1] else 0.0,
            painted=bool(self.painted and rng.random() < self.painted),
            things=int(rng.integers(*self.things, endpoint=True)) if self.things[1] else 0,
        )


@dataclass(frozen=True)
class HarderArenaRange(ArenaRange):
    """The ranges of the harder mix: fewer ramps, obstacles among them, every difficulty, and some ceilings."""

    ramps: tuple[float, float] = (0.2, 0.5)
    clutter: Fixed[tuple[float, float]] = (0.05, 0.2)
    difficulty: tuple[int, int] = (0, 3)
    ceilings: Fixed[float] = 0.2


@dataclass(frozen=True)
class DatasetConfig:
    """Settings of a dataset's scenes, which by default have ramps, light and sensor noise similar to the thesis's.

    Attributes:
        seed: seed of every random number; a different seed gives different scenes.
        frames: number of frames in each scene.
        width: width of the images, pixels.
        height: height of the images, pixels; halving both width and height is four times as fast but shows
            distant objects less well.
        arenas: names or paths of arenas, used in turn, equally often in each split; "random" draws a new one each
            time.
        random: ranges from which each random arena is drawn, bounds included.
        lighting: fractions of the scenes in normal light, in dim light, and in the dark with the robot's lamp on.
        dust: lowest and highest density of dust, 0 to 1, in a quarter of the scenes. By default there is none.
        keyframes: distance (m) and turn (rad) after which the next frame is taken; larger values cover more ground.
        frames_per_second: take frames at a constant rate, as SLAM needs them, instead of by --keyframes.
        clear: fraction of the scenes without dust if --dust is given.
        ideal: fraction of the scenes where the depth sensor makes no errors.
        plugins: the plug-ins to use and their settings, by name; ``--NAME`` adds one.
    """

    seed: int = 0
    frames: int = 100
    width: int = 640
    height: int = 480
    arenas: tuple[str, ...] = (RANDOM,)
    random: ArenaRange = field(default_factory=ArenaRange)
    lighting: tuple[float, float, float] = (1.0, 0.0, 0.0)
    dust: Given[tuple[float, float]] = None
    keyframes: tuple[float, float] = KEYFRAME_SPACING
    frames_per_second: Given[float] = None
    clear: Fixed[float] = 0.75
    ideal: Fixed[float] = 0.0
    plugins: Fixed[Mapping[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, low in (("seed", 0), ("frames", 1), ("width", MIN_IMAGE_SIDE), ("height", MIN_IMAGE_SIDE)):
            check_range(name, getattr(self, name), low)
        if not self.arenas:
            raise InputError("--arenas: give at least one arena")
        if not (min(self.lighting) >= 0 and 0 < sum(self.lighting) < float("inf")):
            raise InputError(
                f"--lighting {' '.join(f'{x:g}' for x in self.lighting)}: fractions must be finite and"
                " non-negative, and not all 0"
            )
        if not all(0.01 <= value <= 10 for value in self.keyframes):
            raise InputError(
                f"--keyframes {self.keyframes[0]:g} {self.keyframes[1]:g}: each value must be between 0.01 and 10"
            )
        if self.frames_per_second is not None:
            check_range("frames-per-second", self.frames_per_second, 0.5, 60)
        if self.dust is not None:
            check_order("dust", self.dust)
        for name in ("clear", "ideal"):
            check_range(name, getattr(self, name), 0, 1)


@dataclass(frozen=True)
class HarderDatasetConfig(DatasetConfig):
    """Settings of the harder mix: half of the scenes in dim light or darkness, some with dust, some without noise."""

    random: HarderArenaRange = field(default_factory=HarderArenaRange)
    lighting: tuple[float, float, float] = (0.5, 0.25, 0.25)
    dust: Given[tuple[float, float]] = (0.02, 0.4)
    ideal: Fixed[float] = 0.1


def check_order(flag: str, bounds: tuple[float, float]) -> None:
    """Raise InputError if the first of two bounds is above the second."""
    if not bounds[0] <= bounds[1]:
        raise InputError(f"--{flag} {bounds[0]} {bounds[1]}: the lower value must come first")


def check_range(flag: str, value: float, low: float, high: float = math.inf) -> None:
    """Raise InputError if a flag's value is not between two bounds."""
    if not low <= value <= high:
        limits = f"must be at least {low:g}" if high == math.inf else f"must be between {low:g} and {high:g}"
        raise InputError(f"--{flag} {value:g}: {limits}")
