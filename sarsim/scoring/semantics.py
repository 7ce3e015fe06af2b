"""How right the labels of the semantic map are."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import THESIS_FOUR, Label
from pipeline.semantic_map.networks.scores import iou
from pipeline.semantic_map.semantic_map import SemanticMap


class SemanticScore:
    """Keeps the true label of every point in a second map of the same voxels, and compares."""

    def __init__(self) -> None:
        """A score of no points."""
        self._truth = SemanticMap()

    def add(self, points: NDArray[np.float32], labels: NDArray[np.uint8]) -> None:
        """Add the (N, 3) points, m, that the robot added to its map, with their (N,) true labels."""
        self._truth.update(points, np.eye(len(Label), dtype=np.float32)[labels])

    def report(self, semantic_map: SemanticMap) -> dict[str, Any]:
        """Intersection over union by label, its means, and the share of right points; nothing without points."""
        return label_figures(confusion_matrix(self._truth.labels(), semantic_map.labels()))


def label_figures(confusion: NDArray[np.int64]) -> dict[str, Any]:
    """The figures of a confusion (8, 8), rows by true label, as :meth:`SemanticScore.report` gives them."""
    if not confusion.any():
        return {}
    iou = iou_by_label(confusion)
    four = [iou[label] for label in THESIS_FOUR if label in iou]
    return {
        "miou_four": float(np.mean(four)) if four else 0.0,
        "miou": float(np.mean(list(iou.values()))),
        "iou": {label.name.lower(): value for label, value in iou.items()},
        "accuracy": float(np.trace(confusion) / confusion.sum()),
        "points": int(confusion.sum()),
    }


def confusion_matrix(truth: NDArray[np.uint8], predicted: NDArray[np.uint8]) -> NDArray[np.int64]:
    """(8, 8) counts, rows by true label; points without a true label are left out."""
    known = truth != Label.UNLABELLED
    n = len(Label)
    flat = truth[known].astype(np.int64) * n + predicted[known]
    return np.bincount(flat, minlength=n * n).reshape(n, n)


def iou_by_label(confusion: NDArray[np.int64]) -> dict[Label, float]:
    """Intersection over union, by a confusion (L, L), of the labels that are true of any pixel or point."""
    values = iou(confusion)
    return {label: float(values[label]) for label in Label if confusion[label].any()}
