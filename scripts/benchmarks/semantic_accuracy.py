"""How right labels are: the network's and the baseline's frame by frame, and those of the map fused from them."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.scoring.semantics import SemanticScore, confusion_matrix, label_figures
from sarsim.scripts.benchmarks.labelled_drives import TrueFrame


def accuracy(frames: Iterable[TrueFrame], network: PointClassifier | None) -> dict[str, dict[str, float]]:
    """Intersection over union by label, and ``miou_four``, of network, fused map and baseline in one arena.

    Without a network the baseline's alone.
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
            score.add(points, np.eye(len(Label), dtype=np.float32)[truth])
    reports = {name: label_figures(counts) for name, counts in confusion.items()}
    reports["fused"] = score.report(fused)
    return {name: {"miou_four": of["miou_four"], **of["iou"]} for name, of in reports.items() if of}


def _labels(probabilities: NDArray[np.float32]) -> NDArray[np.uint8]:
    return probabilities.argmax(axis=1).astype(np.uint8)
