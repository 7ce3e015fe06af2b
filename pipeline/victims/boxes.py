"""Boxes as rows of x0, y0, x1, y1 in pixels: their overlap, and the choice among several boxes of one object."""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

ScoredBoxes = tuple[NDArray[np.float32], NDArray[np.float32]]
"""(N, 4) boxes and their (N, classes) confidences."""


def joined(parts: Iterable[ScoredBoxes]) -> ScoredBoxes:
    """The boxes and confidences of one or more parts, concatenated."""
    boxes, scores = zip(*parts, strict=True)
    return np.concatenate(boxes), np.concatenate(scores)


def pairwise_iou(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, M) intersection over union of (N, 4) with (M, 4) boxes; 0 where both are empty."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    common = np.prod(np.maximum(high - low, 0), axis=2, dtype=np.float64)
    union = _areas(a)[:, None] + _areas(b)[None] - common
    return np.divide(common, union, out=np.zeros_like(common), where=union > 0)


MAX_BOXES = 3000
"""Maximum number of boxes that are compared; the best boxes are chosen.

If a network sees people everywhere, comparing all takes minutes.
"""


def suppress_non_maxima(
    boxes: NDArray[np.float32], scores: NDArray[np.float32], min_confidence: float, overlap: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """One box per object, by non-maximum suppression: (M, 4) and their (M,) scores, the best first.

    Args:
        boxes: (N, 4); empty boxes are dropped.
        scores: (N,) confidences.
        min_confidence: minimum confidence, greater than 0.
        overlap: a box is dropped if its intersection over union with a better box exceeds this value.
    """
    good = (scores >= min_confidence) & (_areas(boxes) > 0)
    boxes = boxes[good]
    scores = scores[good]
    corner_and_size = np.concatenate([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], axis=1)
    kept = np.array(cv2.dnn.NMSBoxes(corner_and_size.tolist(), scores.tolist(), 0, overlap, top_k=MAX_BOXES), np.intp)
    return boxes[kept], scores[kept]


def _areas(boxes: NDArray[np.floating]) -> NDArray[np.floating]:
    """(N,) areas of (N, 4) boxes, square pixels; 0 for a box with x1 < x0 or y1 < y0."""
    return np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0), axis=1)
