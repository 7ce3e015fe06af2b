"""The recipes from which a dataset and each of its scenes are made."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np

from sarsim.arenas.settings import RandomArenaConfig
from sarsim.dataset.settings import RANDOM, DatasetConfig
from sarsim.sensors.air import Air
from sarsim.sensors.conditions import Conditions
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.xtion import Xtion

SPLIT_PERIOD = 10  # Number of scenes after which their splits repeat
RANDOM_PREFIX = "random:"  # Prefix of the names of random arenas; the seed follows
LATERAL_SIGMA_RANGE = (0.5, 1.0)
"""Range of the Xtion's ``lateral_sigma``, pixels; a value is drawn uniformly for each scene."""
DROPOUT_RANGE = (0.0, 0.02)  # Range of the Xtion's ``dropout``, also drawn uniformly for each scene
Purpose = Literal["conditions", "arena", "drive", "noise"]  # Uses of random numbers


@dataclass(frozen=True)
class SceneRecipe:
    """The recipe of one scene.

    Attributes:
        index: number of the scene.
        arena: name or path of the arena.
        random: settings of a random arena; None for other arenas.
        conditions: light, air and sensors.
    """

    index: int
    arena: str
    random: RandomArenaConfig | None
    conditions: Conditions

    def as_json(self) -> dict[str, Any]:
        """The recipe as JSON values."""
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
class Recipe(DatasetConfig):
    """The settings that determine every byte of a dataset's scenes."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for dust in self.dust or ():
            Air(dust)

    def rng(self, index: int, purpose: Purpose) -> np.random.Generator:
        """The random generator for one purpose in scene ``index``; each purpose has its own."""
        return np.random.default_rng([self.seed, index, get_args(Purpose).index(purpose)])

    def conditions(self, index: int) -> Conditions:
        """The light, the air and the depth sensor of scene ``index``, drawn at random."""
        rng = self.rng(index, "conditions")
        noisy = Xtion(
            lateral_sigma=round(rng.uniform(*LATERAL_SIGMA_RANGE), 3), dropout=round(rng.uniform(*DROPOUT_RANGE), 4)
        )
        sensor = Xtion.ideal() if rng.random() < self.ideal else noisy
        shares = np.array(self.lighting, np.float64)
        lighting = list(Lighting)[rng.choice(len(shares), p=shares / shares.sum())]
        if self.dust is None:
            return Conditions(sensor, lighting, Air())
        dusty = Air(round(rng.uniform(*self.dust), 3))
        return Conditions(sensor, lighting, Air() if rng.random() < self.clear else dusty)

    def candidates(self, index: int, count: int) -> Iterator[SceneRecipe]:
        """Yield candidates for scene ``index``, in order: the named arena alone, or ``count`` random arenas."""
        conditions, name = self.conditions(index), self._arena(index)
        if name != RANDOM:
            yield SceneRecipe(index, name, None, conditions)
            return
        rng = self.rng(index, "arena")
        for _ in range(count):
            config = self.random.draw(rng)
            yield SceneRecipe(index, f"{RANDOM_PREFIX}{rng.integers(1 << 31)}", config, conditions)

    def _arena(self, index: int) -> str:
        """The arena of scene ``index``: in turn, but shifted so that each split gets all arenas equally often."""
        count = len(self.arenas)
        shift = index // math.lcm(count, SPLIT_PERIOD) % math.gcd(count, SPLIT_PERIOD)
        return self.arenas[(index + shift) % count]
