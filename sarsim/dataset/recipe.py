"""What a dataset is made of, and what one of its scenes is made of."""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from sarsim.air import Air
from sarsim.arenas.random_arena import RandomArenaConfig
from sarsim.conditions import Conditions
from sarsim.dataset.drive import DriveConfig
from sarsim.lighting import Lighting
from sarsim.xtion import Xtion

RANDOM = "random"


@dataclass(frozen=True)
class ArenaRange:
    """Random arenas are drawn evenly between these values, ends included.

    Attributes:
        tiles: along x and y; a tile is 1.2 m.
        wall_density: share of a maze's inner walls that stand.
        ramps: share of the tiles that are ramps and decks.
        clutter: share of the tiles that something takes.
        victims: number.
        difficulty: 0 flat, to 3 with ramp fields and step fields.
        ceilings: share of the arenas that have one.
    """

    tiles: tuple[int, int] = (4, 8)
    wall_density: tuple[float, float] = (0.2, 0.7)
    ramps: tuple[float, float] = (0.2, 0.5)
    clutter: tuple[float, float] = (0.05, 0.2)
    victims: tuple[int, int] = (1, 4)
    difficulty: tuple[int, int] = (0, 3)
    ceilings: float = 0.3

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
        )


@dataclass(frozen=True)
class LightingShares:
    """How often an arena is lit so; the robot's lamp is on in the dark."""

    normal: float = 0.5
    dim: float = 0.25
    dark: float = 0.25

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

    clear: float = 0.6
    dust: tuple[float, float] = (0.02, 0.4)

    def draw(self, rng: np.random.Generator) -> Air:
        """The air of a scene."""
        dusty = Air(dust=round(rng.uniform(*self.dust), 3))
        return Air() if rng.random() < self.clear else dusty


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
    frames: int = 40
    width: int = 640
    height: int = 480
    arenas: tuple[str, ...] = (RANDOM,)
    random: ArenaRange = field(default_factory=ArenaRange)
    lighting: LightingShares = field(default_factory=LightingShares)
    sensor: SensorRange = field(default_factory=SensorRange)
    air: DustRange = field(default_factory=DustRange)
    drive: DriveConfig = field(default_factory=DriveConfig)


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
