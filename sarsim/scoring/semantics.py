"""Accuracy of the labels of the semantic map."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import THESIS_FOUR, Label
from pipeline.mapper import Keyframe, Observation
from pipeline.segments.cells_kernels import moved
from pipeline.semantic_map.networks.scores import iou
from pipeline.semantic_map.semantic_map import VOXEL, SemanticMap
from pipeline.semantic_map.voxels import VoxelCloud


class KeyframeTruth:
    """The true labels of keyframes, mapped at the keyframes' current poses."""

    def __init__(self, loaded: Sequence[Observation] = ()) -> None:
        """``loaded``: keyframes of an earlier episode, in the robot's map; their true labels are unknown."""
        # A weight so small that any true label outweighs it.
        unknown = 1e-6 * np.eye(1, len(Label), int(Label.UNLABELLED), dtype=np.float32)
        self._added: list[tuple[int, VoxelCloud, NDArray[np.float32]]] = [
            (k, VoxelCloud(o.points, o.hits, np.zeros(0, np.int64)), np.repeat(unknown, len(o.points), axis=0))
            for k, o in enumerate(loaded)
            if o.probabilities is not None
        ]

    def add(self, keyframe: Keyframe) -> None:
        """Keep the true labels of a keyframe, thinned to voxels as in the robot's map."""
        frame = keyframe.frame
        if frame.label is not None:
            cloud = VoxelCloud.of(frame.points(frame.T_base_camera), VOXEL)
            shares = cloud.means(np.eye(len(Label), dtype=np.float32)[frame.label[frame.returns]])
            self._added.append((keyframe.index, replace(cloud, voxel_of_point=np.zeros(0, np.int64)), shares))

    def map_at(self, poses: NDArray[np.float64]) -> SemanticMap:
        """The semantic map with the true labels, of keyframes at (N, 4, 4) ``poses``, ``T_map_base``."""
        truth = SemanticMap()
        for index, cloud, shares in self._added:
            truth.update(moved(poses[index], cloud.points), shares, cloud.hits)
        return truth


def compared(truth: SemanticMap, semantic_map: SemanticMap) -> dict[str, Any]:
    """The figures of a map against one of the same voxels with the true labels; empty without points."""
    return label_figures(confusion_matrix(truth.labels(), semantic_map.labels()))


def label_figures(confusion: NDArray[np.int64]) -> dict[str, Any]:
    """Intersection over union by label, its means, and the accuracy, from a confusion matrix (8, 8)."""
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
    """Intersection over union, from a confusion matrix (L, L), of the labels that occur in the truth."""
    values = iou(confusion)
    return {label: float(values[label]) for label in Label if confusion[label].any()}
