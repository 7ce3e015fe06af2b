"""Random choices that use only integers, so that they are the same on any machine."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


class RandomDraws:
    """Draws random integers, events and elements from a NumPy generator."""

    def __init__(self, rng: np.random.Generator):
        self.rng = rng

    def number(self, low: int, high: int) -> int:
        """A random integer from ``low`` to ``high``, both included."""
        return int(self.rng.integers(low, high + 1))

    def chance(self, probability: float) -> bool:
        """True with probability ``probability``, rounded to a hundredth."""
        return self.number(0, 99) < round(100 * probability)

    def pick(self, choice: Sequence[T]) -> T:
        """A random element of ``choice``."""
        return choice[self.number(0, len(choice) - 1)]

    def shuffled(self, choice: Sequence[T]) -> list[T]:
        """All elements of ``choice`` in random order."""
        return [choice[k] for k in self.rng.permutation(len(choice))]
