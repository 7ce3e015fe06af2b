"""What a dataset is made of, and what one of its scenes is made of."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

import numpy as np

from pipeline.errors import InputError
from sarsim.arenas.settings import RandomArenaConfig
from sarsim.dataset.arena_range import ArenaRange, check_order, check_share
from sarsim.dataset.drive import DriveConfig
from sarsim.sensors.air import Air
from sarsim.sensors.conditions import Conditions
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.xtion import Xtion

RANDOM = "random"
PREFIX = "random:"
"""of the names of random arenas; the seed follows."""
MIN_SIZE = 16
"""pixels of an image."""
MAX_LATERAL_SIGMA = 10
"""pixels."""
Purpose = Literal["conditions", "arena", "drive", "noise"]
"""Of random numbers."""


@dataclass(frozen=True)
class LightingShares:
    """How often an arena is lit so; the robot's lamp is on in the dark."""

    normal: float = 0.5
    dim: float = 0.25
    dark: float = 0.25

    def __post_init__(self) -> None:
        shares = (self.normal, self.dim, self.dark)
        if not (min(shares) >= 0 and 0 < sum(shares) < float("inf")):
            raise InputError(f"--lighting: {shares} are no shares")

    def draw(self, rng: np.random.Generator) -> Lighting:
        """One of them."""
        shares = np.array([getattr(self, kind.name) for kind in Lighting], np.float64)
        return list(Lighting)[rng.choice(len(shares), p=shares / shares.sum())]


@dataclass(frozen=True)
class SensorRange:
    """How good the Xtion is in a scene.

    Attributes:
        ideal: share of the scenes where it makes no errors.
        lateral_sigma: pixels, of its frayed edges, drawn evenly between these values.
        dropout: share of the pixels that return nothing for no reason, likewise.
    """

    ideal: float = 0.1
    lateral_sigma: tuple[float, float] = (0.5, 1.0)
    dropout: tuple[float, float] = (0.0, 0.02)

    def __post_init__(self) -> None:
        check_share("sensor.ideal", self.ideal)
        check_order("sensor.lateral-sigma", self.lateral_sigma)
        check_order("sensor.dropout", self.dropout)
        if not (self.lateral_sigma[0] >= 0 and self.lateral_sigma[1] <= MAX_LATERAL_SIGMA):
            raise InputError(f"--sensor.lateral-sigma: from 0 to {MAX_LATERAL_SIGMA} pixels")
        for share in self.dropout:
            check_share("sensor.dropout", share)

    def draw(self, rng: np.random.Generator) -> Xtion:
        """One of these sensors."""
        noisy = Xtion(
            lateral_sigma=round(rng.uniform(*self.lateral_sigma), 3),
            dropout=round(rng.uniform(*self.dropout), 4),
        )
        return Xtion.ideal() if rng.random() < self.ideal else noisy


@dataclass(frozen=True)
class DustRange:
    """How much dust is in the air.

    Attributes:
        clear: share of the scenes without any.
        dust: concentration in the others, from 0 to 1, drawn evenly between these values.
    """

    clear: float = 0.75
    dust: tuple[float, float] = (0.02, 0.4)

    def __post_init__(self) -> None:
        check_share("air.clear", self.clear)
        check_order("air.dust", self.dust)
        for dust in self.dust:
            Air(dust=dust)

    def draw(self, rng: np.random.Generator) -> Air:
        """The air of a scene."""
        dusty = Air(dust=round(rng.uniform(*self.dust), 3))
        return Air() if rng.random() < self.clear else dusty


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

    @property
    def random_seed(self) -> int:
        """Of a random arena."""
        return int(self.arena.removeprefix(PREFIX))

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
        frames: looks a scene.
        width: of the images, pixels.
        height: of the images, pixels.
        arenas: names or paths, taken in turn; "random" is another random arena each time.
        random: what those are like.
        lighting: how often each.
        sensor: its errors.
        air: dust in it.
        drive: how the robot drives, and when it looks.
    """

    seed: int = 0
    frames: int = 100
    width: int = 640
    height: int = 480
    arenas: tuple[str, ...] = (RANDOM,)
    random: ArenaRange = field(default_factory=ArenaRange)
    lighting: LightingShares = field(default_factory=LightingShares)
    sensor: SensorRange = field(default_factory=SensorRange)
    air: DustRange = field(default_factory=DustRange)
    drive: DriveConfig = field(default_factory=DriveConfig)

    def __post_init__(self) -> None:
        """Refuse what cannot be made."""
        for name, low in (("seed", 0), ("frames", 1), ("width", MIN_SIZE), ("height", MIN_SIZE)):
            if getattr(self, name) < low:
                raise InputError(f"--{name} {getattr(self, name)}: at least {low}")
        if not self.arenas:
            raise InputError("--arenas: name at least one")

    def rng(self, index: int, purpose: Purpose) -> np.random.Generator:
        """The random numbers for one purpose in scene ``index``, the same whoever draws them."""
        return np.random.default_rng([self.seed, index, get_args(Purpose).index(purpose)])

    def conditions(self, index: int) -> Conditions:
        """Of scene ``index``."""
        rng = self.rng(index, "conditions")
        return Conditions(self.sensor.draw(rng), self.lighting.draw(rng), self.air.draw(rng))

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
