"""How right labels are: the network's and the baseline's frame by frame, and those of the map fused from them."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.scoring.semantics import SemanticScore, confusion_matrix, label_figures
from sarsim.scripts.benchmarks.labelled_drives import TrueFrame


class Tally:
    """The labels of some frames against the true ones, and those of the map fused from them."""

    def __init__(self) -> None:
        """No frames yet."""
        self._confusion = np.zeros((len(Label), len(Label)), np.int64)
        self._map, self._score = SemanticMap(), SemanticScore()

    def add(self, frame: TrueFrame, given: NDArray[np.float32]) -> None:
        """Count the (N, 8) probabilities that the returns of a frame were given."""
        points, truth = frame.points, frame.labels
        self._confusion += confusion_matrix(truth, given.argmax(axis=1).astype(np.uint8))
        self._map.update(points, given)
        self._score.add(points, np.eye(len(Label), dtype=np.float32)[truth])

    def frames(self) -> dict[str, float]:
        """IoU by label, and ``miou_four``, of every return of every frame."""
        return _flat(label_figures(self._confusion))

    def fused(self) -> dict[str, float]:
        """The same of the points of the map."""
        return _flat(self._score.report(self._map))


def accuracy(frames: Iterable[TrueFrame], network: PointClassifier | None) -> dict[str, dict[str, float]]:
    """Intersection over union by label, and ``miou_four``, of network, fused map and baseline in one arena.

    Without a network the baseline's alone.
    """
    contenders: dict[str, PointClassifier] = {"baseline": RuleClassifier()}
    contenders |= {} if network is None else {"network": network}
    tallies = {name: Tally() for name in contenders}
    for frame in frames:
        for name, contender in contenders.items():
            tallies[name].add(frame, contender.classify(frame.frame, frame.points, frame.T_map_camera))
    scores = {name: tally.frames() for name, tally in tallies.items()}
    scores |= {} if network is None else {"fused": tallies["network"].fused()}
    return {name: score for name, score in scores.items() if score}


def _flat(report: dict[str, Any]) -> dict[str, float]:
    return {"miou_four": report["miou_four"], **report["iou"]} if report else {}
