"""Random choices based only on integers, so that a seed gives the same choices on any machine."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


class RandomDraws:
    """Makes random choices with a NumPy generator."""

    def __init__(self, rng: np.random.Generator):
        self.rng = rng

    def number(self, low: int, high: int) -> int:
        """A random integer from ``low`` to ``high``, both included."""
        return int(self.rng.integers(low, high + 1))

    def chance(self, probability: float) -> bool:
        """True with a probability of ``probability``, rounded to hundredths."""
        return self.number(0, 99) < round(100 * probability)

    def pick(self, choice: Sequence[T]) -> T:
        """A random element of ``choice``."""
        return choice[self.number(0, len(choice) - 1)]

    def shuffled(self, choice: Sequence[T]) -> list[T]:
        """All elements of ``choice`` in random order."""
        return [choice[k] for k in self.rng.permutation(len(choice))]
