"""What a dataset is made of, and what one of its scenes is made of."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal, get_args

import numpy as np
import tyro

from pipeline.errors import InputError
from sarsim.arenas.settings import RandomArenaConfig
from sarsim.dataset.arena_range import ArenaRange, check, check_order
from sarsim.dataset.drive import KEYFRAMES
from sarsim.sensors.air import Air
from sarsim.sensors.conditions import Conditions
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.xtion import Xtion

RANDOM = "random"
PREFIX = "random:"
"""of the names of random arenas; the seed follows."""
MIN_SIZE = 16
"""pixels of an image."""
LATERAL_SIGMA = (0.5, 1.0)
"""pixels, of the Xtion's frayed edges, drawn evenly between these values for each scene."""
DROPOUT = (0.0, 0.02)
"""Share of the pixels that return nothing for no reason, likewise."""
Purpose = Literal["conditions", "arena", "drive", "noise"]
"""Of random numbers."""


@dataclass(frozen=True)
class SceneRecipe:
    """What one scene is made of.

    Attributes:
        index: of the scene.
        arena: name or path.
        random: what a random arena is like.
        conditions: of light, air and sensors.
    """

    index: int
    arena: str
    random: RandomArenaConfig | None
    conditions: Conditions

    def as_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        conditions = self.conditions
        return {
            "index": self.index,
            "arena": self.arena,
            "random": None if self.random is None else asdict(self.random),
            "lighting": conditions.lighting.name,
            "dust": conditions.air.dust,
            "sensor": asdict(conditions.depth_sensor),
        }


@dataclass(frozen=True)
class Recipe:
    """What decides every byte of a dataset's scenes.

    Attributes:
        seed: of everything random.
        frames: per scene.
        width: of the images, pixels.
        height: of the images, pixels.
        arenas: names or paths, taken in turn; "random" is another random arena each time.
        random: what those are like.
        lighting: shares of the scenes in normal light, in dim light, and in the dark with the robot's lamp on.
        dust: concentration in the scenes with dust in the air, from 0 to 1, drawn evenly between these values.
        keyframes: m driven and rad turned from one frame to the next.
        frames_per_second: if given, how often there is a frame instead, wherever the robot is.
        clear: share of the scenes without dust.
        ideal: share of the scenes where the depth sensor makes no errors.
    """

    seed: int = 0
    frames: int = 100
    width: int = 640
    height: int = 480
    arenas: tuple[str, ...] = (RANDOM,)
    random: ArenaRange = field(default_factory=ArenaRange)
    lighting: tuple[float, float, float] = (0.5, 0.25, 0.25)
    dust: tuple[float, float] = (0.02, 0.4)
    keyframes: tuple[float, float] = KEYFRAMES
    frames_per_second: float | None = None
    clear: Annotated[float, tyro.conf.Suppress] = 0.75
    ideal: Annotated[float, tyro.conf.Suppress] = 0.1

    def __post_init__(self) -> None:
        """Refuse what cannot be made."""
        for name, low in (("seed", 0), ("frames", 1), ("width", MIN_SIZE), ("height", MIN_SIZE)):
            check(name, getattr(self, name), low)
        if not self.arenas:
            raise InputError("--arenas: name at least one")
        if not (min(self.lighting) >= 0 and 0 < sum(self.lighting) < float("inf")):
            raise InputError(f"--lighting: {self.lighting} are no shares")
        if not all(0.01 <= value <= 10 for value in self.keyframes):
            raise InputError(f"--keyframes {self.keyframes[0]:g} {self.keyframes[1]:g}: from 0.01 to 10 each")
        if self.frames_per_second is not None:
            check("frames-per-second", self.frames_per_second, 0.5, 60)
        check_order("dust", self.dust)
        for name in ("clear", "ideal"):
            check(name, getattr(self, name), 0, 1)
        for dust in self.dust:
            Air(dust)

    def rng(self, index: int, purpose: Purpose) -> np.random.Generator:
        """The random numbers for one purpose in scene ``index``: each purpose has its own."""
        return np.random.default_rng([self.seed, index, get_args(Purpose).index(purpose)])

    def conditions(self, index: int) -> Conditions:
        """Of scene ``index``."""
        rng = self.rng(index, "conditions")
        noisy = Xtion(lateral_sigma=round(rng.uniform(*LATERAL_SIGMA), 3), dropout=round(rng.uniform(*DROPOUT), 4))
        sensor = Xtion.ideal() if rng.random() < self.ideal else noisy
        shares = np.array(self.lighting, np.float64)
        lighting = list(Lighting)[rng.choice(len(shares), p=shares / shares.sum())]
        dusty = Air(round(rng.uniform(*self.dust), 3))
        return Conditions(sensor, lighting, Air() if rng.random() < self.clear else dusty)

    def scenes(self, index: int, count: int) -> Iterator[SceneRecipe]:
        """The first of these that can be built is scene ``index``; only of random arenas there are several."""
        conditions, name = self.conditions(index), self.arenas[index % len(self.arenas)]
        if name != RANDOM:
            yield SceneRecipe(index, name, None, conditions)
            return
        rng = self.rng(index, "arena")
        for _ in range(count):
            config = self.random.draw(rng)
            yield SceneRecipe(index, f"{PREFIX}{rng.integers(1 << 31)}", config, conditions)
