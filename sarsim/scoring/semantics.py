"""Accuracy of the labels of the semantic map."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.keyframes import Keyframes, kept_cloud
from pipeline.labels import THESIS_FOUR, Label
from pipeline.mapper import Keyframe
from pipeline.semantic_map.class_shares import ClassShares
from pipeline.semantic_map.config import SemanticMapConfig
from pipeline.semantic_map.networks.scores import iou
from pipeline.semantic_map.semantic_map import SemanticMap


class KeyframeTruth:
    """The true labels of keyframes, mapped at the keyframes' current poses."""

    def __init__(self, keyframes: Keyframes, voxel: float) -> None:
        """``keyframes``: the robot's; the true labels of those that exist already are unknown. ``voxel``: edge, m."""
        self._voxel = voxel
        self._keyframes = keyframes
        self._shares: dict[int, ClassShares | None] = {k: None for k, s in enumerate(keyframes.seen) if s.shares}

    def add(self, keyframe: Keyframe) -> None:
        """Keep the true labels of a keyframe, thinned to voxels as in the robot's map."""
        frame = keyframe.frame
        if frame.label is not None:
            cloud, near = kept_cloud(frame.points(frame.T_base_camera), self._voxel)
            shares = cloud.means(np.eye(len(Label), dtype=np.float32)[frame.label[frame.returns]])
            self._shares[keyframe.index] = ClassShares.of(shares[near])

    def map(self) -> SemanticMap:
        """The semantic map with the true labels at the keyframes' current poses."""
        truth, keyframes = SemanticMap(config=SemanticMapConfig(voxel=self._voxel)), self._keyframes
        for k, shares in self._shares.items():
            seen, T = keyframes.seen[k], keyframes.poses[k]
            if shares is not None:
                truth.update(seen.points_at(T), shares.probabilities, seen.hits)
            else:
                # A weight so small that any true label outweighs it.
                unknown = 1e-6 * np.eye(1, len(Label), int(Label.UNLABELLED), dtype=np.float32)
                truth.update(seen.points_at(T), np.repeat(unknown, len(seen.points), axis=0), seen.hits)
        return truth


def compared(truth: SemanticMap, semantic_map: SemanticMap) -> dict[str, Any]:
    """The figures of a map, compared with one that has the true labels of the same voxels; empty without points."""
    return label_figures(confusion_matrix(truth.labels(), semantic_map.labels()))


def label_figures(confusion: NDArray[np.int64]) -> dict[str, Any]:
    """Intersection over union by label, its means, and the overall accuracy, from a confusion matrix (8, 8)."""
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
    """Intersection over union of each label that occurs in the truth, from a confusion matrix (L, L)."""
    values = iou(confusion)
    return {label: float(values[label]) for label in Label if confusion[label].any()}
