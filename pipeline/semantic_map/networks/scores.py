"""How well classes were told apart."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import THESIS_FOUR
from pipeline.semantic_map.classifier import CLASSES

_FOUR = [CLASSES.index(label) for label in THESIS_FOUR]


@dataclass(frozen=True, eq=False)
class Confusion:
    """Returns by true class (row) and class that they were given (column): (6, 6) int64."""

    counts: NDArray[np.int64]

    @classmethod
    def of(cls, counts: NDArray[np.integer], classes: NDArray[np.integer]) -> "Confusion":
        """From (M, 6) returns by true class in the voxel of every point, and the (M,) classes that it was given."""
        result = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
        np.add.at(result.T, classes, counts)
        return cls(result)

    def __add__(self, other: "Confusion") -> "Confusion":
        return Confusion(self.counts + other.counts)

    @property
    def iou(self) -> NDArray[np.float64]:
        """(6,) intersection over union of every class; NaN where it neither is nor was given."""
        hits = np.diag(self.counts)
        union = self.counts.sum(axis=0) + self.counts.sum(axis=1) - hits
        return np.divide(hits, union, out=np.full(len(hits), np.nan), where=union > 0)

    @property
    def miou_four(self) -> float:
        """Mean over those of the thesis's four classes that occur."""
        occurring = [c for c in _FOUR if self.counts[c].any()]
        return float(self.iou[occurring].mean()) if occurring else float("nan")
