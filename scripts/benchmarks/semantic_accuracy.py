"""How right labels are: the network's and the baseline's frame by frame, and those of the map fused from them."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import THESIS_FOUR, Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.networks.scores import mean_iou
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.scoring.semantics import SemanticScore, confusion_matrix, iou_by_label
from sarsim.scripts.benchmarks.labelled_drives import TrueFrame


def accuracy(frames: Iterable[TrueFrame], network: PointClassifier | None) -> dict[str, dict[str, float]]:
    """Intersection over union by label, and ``miou_four``, of network, fused map and baseline.

    Args:
        frames: of one arena.
        network: if there is none, the baseline's figures alone.
    """
    baseline = RuleClassifier()
    confusion = {name: np.zeros((len(Label), len(Label)), np.int64) for name in ("network", "baseline")}
    fused, score = SemanticMap(), SemanticScore()
    for frame in frames:
        points, truth = frame.points, frame.labels
        given = baseline.classify(frame.frame, points, frame.T_map_camera)
        confusion["baseline"] += confusion_matrix(truth, _labels(given))
        if network is not None:
            given = network.classify(frame.frame, points, frame.T_map_camera)
            confusion["network"] += confusion_matrix(truth, _labels(given))
            fused.update(points, given)
            score.add(points, truth)
    figures = {name: _figures(counts) for name, counts in confusion.items() if counts.any()}
    if network is not None:
        report = score.report(fused)
        figures["fused"] = {"miou_four": report["miou_four"], **report["iou"]}
    return figures


def _labels(probabilities: NDArray[np.float32]) -> NDArray[np.uint8]:
    return probabilities.argmax(axis=1).astype(np.uint8)


def _figures(confusion: NDArray[np.int64]) -> dict[str, float]:
    by_label = {label.name.lower(): value for label, value in iou_by_label(confusion).items()}
    return {"miou_four": mean_iou(confusion, THESIS_FOUR), **by_label}
