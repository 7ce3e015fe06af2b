"""Accuracy of classifiers' labels frame by frame, and of the labels of the maps fused from them."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.scoring.semantics import compared, confusion_matrix, label_figures
from scripts.benchmarks.labelled_drives import PosedFrame

Change = Callable[[PosedFrame, NDArray[np.float32]], NDArray[np.float32]]
"""A function that modifies the (N, 8) probabilities given by a classifier to the returns of a frame."""
AS_GIVEN: Mapping[str, Change] = {"": lambda frame, given: given}
KINDS = ("frame", "voxels", "fused")
Scores = dict[str, dict[str, dict[str, float]]]
"""``miou_four`` and the IoU by label, keyed by classifier name plus suffix of the change, then by kind."""


class Tally:
    """Compares labels of frames, and of the map fused from them, with the true labels."""

    def __init__(self) -> None:
        self._returns, self._voxels = np.zeros((2, len(Label), len(Label)), np.int64)
        self._map, self._truth = SemanticMap(), SemanticMap()

    def add(self, frame: PosedFrame, given: NDArray[np.float32]) -> None:
        """Add the (N, 8) probabilities given by a classifier to the returns of a frame."""
        points, truth = frame.points, np.eye(len(Label), dtype=np.float32)[frame.labels]
        self._returns += confusion_matrix(frame.labels, given.argmax(axis=1).astype(np.uint8))
        alone, true = SemanticMap(), SemanticMap()
        for labels, of in ((alone, given), (true, truth), (self._map, given), (self._truth, truth)):
            labels.update(points, of)
        self._voxels += confusion_matrix(true.labels(), alone.labels())

    def scores(self) -> dict[str, dict[str, float]]:
        """IoU by label and ``miou_four``, by kind: over frames' returns, frames' voxels, and the fused map's voxels.

        Near surfaces have many more returns than far ones, but no more voxels, so only the last two are comparable.
        """
        figures = label_figures(self._returns), label_figures(self._voxels), compared(self._truth, self._map)
        return {kind: _flat(of) for kind, of in zip(KINDS, figures, strict=True)}


def scores(
    frames: Iterable[PosedFrame], classifiers: Mapping[str, PointClassifier], changes: Mapping[str, Change] = AS_GIVEN
) -> Scores:
    """The scores of every classifier in one arena, for each of the ``changes`` to its probabilities."""
    tallies = {name + change: Tally() for name in classifiers for change in changes}
    for frame in frames:
        for name, classifier in classifiers.items():
            given = classifier.classify(frame.frame, frame.points, frame.T_map_camera)
            for change, changed in changes.items():
                tallies[name + change].add(frame, changed(frame, given))
    return {name: tally.scores() for name, tally in tallies.items()}


def accuracy(frames: Iterable[PosedFrame], network: PointClassifier | None) -> dict[str, dict[str, float]]:
    """IoU by label, and ``miou_four``, of the network, its fused map and the baseline in one arena.

    Without a network, only the baseline is scored.
    """
    contenders: dict[str, PointClassifier] = {"baseline": RuleClassifier()}
    reached = scores(frames, contenders | ({} if network is None else {"network": network}))
    scored = {name: of["frame"] for name, of in reached.items()}
    scored |= {} if network is None else {"fused": reached["network"]["fused"]}
    return {name: score for name, score in scored.items() if score}


def _flat(report: dict[str, Any]) -> dict[str, float]:
    return {"miou_four": report["miou_four"], **report["iou"]} if report else {}
