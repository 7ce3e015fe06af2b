"""Accuracy of the semantic map: of its labels, and of its points relative to the true surfaces in view."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.geometry.thinning import VoxelCloud
from pipeline.keyframes import Keyframes, kept_cloud
from pipeline.labels import THESIS_FOUR, Label
from pipeline.mapper import Keyframe
from pipeline.semantic_map.config import SemanticMapConfig
from pipeline.semantic_map.networks.scores import iou
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.semantic_map.top_two_classes import TopTwoClasses

F1_DISTANCES = {"f1_5cm": 0.05, "f1_10cm": 0.1}
"""Distance within which a point is correct, m, by the name of the figure."""


class KeyframeTruth:
    """The true labels of keyframes, mapped at the keyframes' current poses."""

    def __init__(self, keyframes: Keyframes, voxel: float) -> None:
        """Start without true labels.

        Args:
            keyframes: the robot's keyframes; the true labels of keyframes that already exist are unknown.
            voxel: edge of a voxel, m.
        """
        self._voxel = voxel
        self._keyframes = keyframes
        self._top_two_classes: dict[int, TopTwoClasses | None] = {
            k: None for k, s in enumerate(keyframes.observations) if s.top_two_classes
        }

    def add(self, keyframe: Keyframe) -> None:
        """Store the true labels of a keyframe, thinned to voxels as in the robot's map."""
        frame = keyframe.frame
        if frame.label is not None:
            cloud, near = kept_cloud(frame.points(frame.T_base_camera), self._voxel)
            shares = cloud.means(np.eye(len(Label), dtype=np.float32)[frame.label[frame.returns]])
            self._top_two_classes[keyframe.index] = TopTwoClasses.of(shares[near])

    def map(self) -> SemanticMap:
        """The semantic map with the true labels at the keyframes' current poses."""
        truth, keyframes = SemanticMap(config=SemanticMapConfig(voxel=self._voxel)), self._keyframes
        for k, shares in self._top_two_classes.items():
            seen, T = keyframes.observations[k], keyframes.poses[k]
            if shares is not None:
                truth.update(seen.points_at(T), shares.probabilities, seen.hits)
            else:
                # A weight so small that any true label outweighs it.
                unknown = 1e-6 * np.eye(1, len(Label), int(Label.UNLABELLED), dtype=np.float32)
                truth.update(seen.points_at(T), np.repeat(unknown, len(seen.points), axis=0), seen.hits)
        return truth


def map_figures(truth: SemanticMap, semantic_map: SemanticMap) -> dict[str, Any]:
    """The figures of a map, compared with a map of the true labels of the same voxels; empty without points."""
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


class SurfaceScore:
    """Collects noise-free points, in the world, thinned to voxels as in the semantic map."""

    def __init__(self, voxel: float) -> None:
        """Start without points; ``voxel``: edge of the map's voxels, m."""
        self._voxel = voxel
        self._surface, self._new = np.zeros((0, 3), np.float32), list[NDArray[np.float32]]()

    def add(self, points: NDArray[np.float32]) -> None:
        """Add the noise-free points (N, 3) of a frame, m in ``world``."""
        self._new.append(VoxelCloud.of(points, self._voxel).points)
        if sum(map(len, self._new)) > len(self._surface):  # so that each point is thinned again only a few times
            self._merge()

    def _merge(self) -> None:
        self._surface = VoxelCloud.of(np.concatenate([self._surface, *self._new]), self._voxel).points
        self._new.clear()

    def report(self, points: NDArray[np.float32]) -> dict[str, float]:
        """The figures of a map with points (M, 3), m; empty if nothing was seen."""
        self._merge()
        return f1_scores(points, self._surface) if len(self._surface) else {}


def f1_scores(points: NDArray[np.float32], surface: NDArray[np.float32]) -> dict[str, float]:
    """The F1 score for each distance in :data:`F1_DISTANCES`: the harmonic mean of precision and recall.

    Precision is the fraction of the points (M, 3) m within that distance of the surface (N, 3) m. Recall is the
    fraction of the surface's points within that distance of the points (Knapitsch et al., "Tanks and Temples", 2017).
    """
    if not len(points):
        return dict.fromkeys(F1_DISTANCES, 0.0)
    farthest = max(F1_DISTANCES.values())
    apart = [cKDTree(b).query(a, distance_upper_bound=farthest)[0] for a, b in ((points, surface), (surface, points))]
    shares = {name: [float(np.mean(d <= within)) for d in apart] for name, within in F1_DISTANCES.items()}
    return {name: 2 * p * r / (p + r) if p + r else 0.0 for name, (p, r) in shares.items()}
