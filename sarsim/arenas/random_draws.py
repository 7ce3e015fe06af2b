"""Random choices by whole numbers alone, which are the same on any machine."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


class RandomDraws:
    """Draws from a generator."""

    def __init__(self, rng: np.random.Generator):
        self.rng = rng

    def number(self, low: int, high: int) -> int:
        """From ``low`` to ``high``, both included."""
        return int(self.rng.integers(low, high + 1))

    def chance(self, share: float) -> bool:
        """True with this probability, to a hundredth."""
        return self.number(0, 99) < round(100 * share)

    def pick(self, choice: Sequence[T]) -> T:
        """One of them."""
        return choice[self.number(0, len(choice) - 1)]

    def shuffled(self, choice: Sequence[T]) -> list[T]:
        """All of them in another order."""
        return [choice[k] for k in self.rng.permutation(len(choice))]
