"""Scores of a classifier from its confusion matrix (C, C): counts by true (row) and predicted class (column)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def confusion_of(counts: NDArray[np.integer], given: NDArray[np.integer]) -> NDArray[np.int64]:
    """The confusion matrix (C, C), from the points' (M, C) counts of returns by true class and (M,) predictions."""
    result = np.zeros((counts.shape[1], counts.shape[1]), np.int64)
    np.add.at(result.T, given, counts)
    return result


def iou(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """(C,) intersection over union of every class; NaN for a class that neither occurs nor is predicted."""
    hits = np.diag(confusion)
    union = confusion.sum(axis=0) + confusion.sum(axis=1) - hits
    return np.divide(hits, union, out=np.full(len(hits), np.nan), where=union > 0)


def mean_iou(confusion: NDArray[np.int64], classes: Sequence[int]) -> float:
    """Mean IoU from a confusion matrix (C, C), over the given classes that occur; NaN if none of them occurs."""
    occurring = [c for c in classes if confusion[c].any()]
    return float(iou(confusion)[occurring].mean()) if occurring else float("nan")
