"""Average precision of one class as COCO computes it (Lin et al., arXiv:1405.0312, and its published evaluation).

Unlike in COCO, precision is evaluated at every recall, not at 101 recall values.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.victims.boxes import pairwise_iou

MATCHING_IOU = 0.5  # Minimum intersection over union of a detection with its true box


class AveragePrecision:
    """Average precision, at an overlap of ``MATCHING_IOU``, of detections that are added image by image."""

    def __init__(self) -> None:
        self._scores: list[float] = []
        self._right: list[bool] = []
        self._present = 0

    def add(
        self,
        boxes: NDArray[np.floating],
        scores: NDArray[np.floating],
        truths: NDArray[np.floating],
        ignored: NDArray[np.bool_],
    ) -> None:
        """Add an image: (N, 4) detections and their (N,) scores, (M, 4) true boxes and whether each is ignored."""
        order = np.argsort(-scores, kind="stable")
        found = match(pairwise_iou(boxes[order], truths), ignored, MATCHING_IOU)
        counts = (found < 0) | ~np.append(ignored, False)[found]
        self._scores += scores[order][counts].tolist()
        self._right += (found >= 0)[counts].tolist()
        self._present += int((~ignored).sum())

    @property
    def value(self) -> float:
        """Area under the decreasing envelope of precision over recall; NaN if there were no boxes to find."""
        if self._present == 0:
            return float("nan")
        right = np.array(self._right, bool)[np.argsort(-np.array(self._scores), kind="stable")]
        found = np.cumsum(right)
        precision = found / np.arange(1, len(right) + 1)
        highest = np.maximum.accumulate(precision[::-1])[::-1]
        return float(highest[right].sum() / self._present)


def match(overlap: NDArray[np.floating], ignored: NDArray[np.bool_], min_overlap: float) -> NDArray[np.intp]:
    """Match detections with true boxes.

    Each detection is matched with the true box with the greatest overlap that no better detection has taken. If there
    is no such box, the detection may be matched with an ignored box; several detections may share an ignored box.

    Args:
        overlap: (N, M) intersection over union of the detections, the best first, with the true boxes.
        ignored: (M,) bool, whether to ignore each true box.
        min_overlap: minimum overlap of a match.

    Returns:
        (N,) index of each detection's true box, −1 = none.
    """
    free = np.ones(len(ignored), bool)
    found = np.full(len(overlap), -1, np.intp)
    for detection, row in enumerate(overlap):
        for candidates in (free & ~ignored, ignored):
            near = np.where(candidates & (row >= min_overlap), row, -1)
            if found[detection] < 0 and near.max(initial=-1) >= 0:
                found[detection] = near.argmax()
        if found[detection] >= 0:
            free[found[detection]] = False
    return found
