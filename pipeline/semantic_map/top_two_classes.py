"""Class probabilities of points in three bytes each: the two most probable classes and the fraction of the first."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Probabilities
from pipeline.labels import Label
from pipeline.semantic_map.semantic_map_kernels import class_fractions

WHOLE = np.iinfo(np.uint8).max
"""Sum of the fractions of a point's two classes."""


@dataclass(frozen=True, eq=False)
class TopTwoClasses:
    """The two most probable classes of each point.

    Attributes:
        classes: (N, 2) uint8, the most probable class and the next; the lower id wins a tie.
        share: (N,) uint8, the first class's part of ``WHOLE``; the second class has the rest.
    """

    classes: NDArray[np.uint8]
    share: NDArray[np.uint8]

    @classmethod
    def of(cls, probabilities: Probabilities) -> Self:
        """Keep the two most probable classes, with their probabilities scaled to a sum of 1."""
        best = np.argsort(-probabilities, axis=1, kind="stable")[:, :2]
        first, second = np.take_along_axis(probabilities, best, axis=1).T
        both = np.maximum(first + second, np.finfo(np.float32).tiny)
        return cls(best.astype(np.uint8), np.rint(WHOLE * (first / both)).astype(np.uint8))

    @property
    def nbytes(self) -> int:
        """Size of the arrays in bytes."""
        return self.classes.nbytes + self.share.nbytes

    @property
    def probabilities(self) -> NDArray[np.uint8]:
        """(N, 8) uint8 probability of every class, in units of 1/255."""
        return class_fractions(self.classes, self.share, WHOLE, len(Label))
