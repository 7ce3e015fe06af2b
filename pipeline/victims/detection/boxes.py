"""Boxes as rows of x0, y0, x1, y1 in pixels: decoding, overlap and suppression."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from pipeline.victims.detection.yolo import OBJECTNESS, Grid

Boxes = tuple[NDArray[np.float32], NDArray[np.float32]]
"""(N, 4) boxes and their (N, classes) confidences."""
LARGEST_EXPONENT = 20.0
"""Limit of the exponent that scales an anchor: no box in an image is so large, and its square still fits float32."""


def decode(head: NDArray[np.float32], grid: Grid, width: int, height: int, threshold: float) -> Boxes:
    """Decode the boxes of one grid with the equations of section 2.1 of YOLOv3.

    Args:
        head: (anchors · NUMBERS, H, W) output of the network for this grid.
        grid: the head's grid.
        width, height: size of the network's input, pixels.
        threshold: minimum objectness, greater than 0.

    Returns:
        (N, 4) boxes in the network's input, pixels, and (N, 1) objectness times the probability of the class.
    """
    rows, columns = head.shape[1:]
    cells = head.reshape(len(grid.mask), -1, rows, columns)
    anchor, y, x = np.nonzero(cells[:, OBJECTNESS] >= logit(threshold))
    found = cells[anchor, :, y, x]
    shares = expit(found)
    middle = (shares[:, :2] + np.stack([x, y], axis=1)) * (width / columns, height / rows)
    sizes = np.array(grid.anchors)[list(grid.mask)][anchor]
    half = np.exp(np.minimum(found[:, 2:OBJECTNESS], LARGEST_EXPONENT)) * sizes / 2
    boxes = np.concatenate([middle - half, middle + half], axis=1)
    return boxes.astype(np.float32), shares[:, OBJECTNESS + 1 :] * shares[:, OBJECTNESS, None]


def joined(parts: Iterable[Boxes]) -> Boxes:
    """All boxes of one or more parts."""
    boxes, scores = zip(*parts, strict=True)
    return np.concatenate(boxes), np.concatenate(scores)


def areas(boxes: NDArray[np.floating]) -> NDArray[np.floating]:
    """(N,) areas of (N, 4) boxes, square pixels; 0 for a box with x1 < x0 or y1 < y0."""
    return np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0), axis=1)


def overlaps(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, M) intersection over union of (N, 4) with (M, 4) boxes; 0 where both are empty."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    common = np.prod(np.maximum(high - low, 0), axis=2, dtype=np.float64)
    union = areas(a)[:, None] + areas(b)[None] - common
    return np.divide(common, union, out=np.zeros_like(common), where=union > 0)


def suppress(
    boxes: NDArray[np.floating], scores: NDArray[np.floating], overlap: float, most: int
) -> NDArray[np.intp]:
    """Greedy non-maximum suppression of (N, 4) boxes with scores (N,): (M,) indices of those kept, the best first.

    Boxes whose IoU with a better one exceeds ``overlap`` are dropped. Only the ``most`` best boxes are considered.
    """
    order = np.argsort(-scores, kind="stable")[:most]
    kept: list[int] = []
    while len(order):
        best, order = order[0], order[1:]
        kept.append(best)
        order = order[overlaps(boxes[[best]], boxes[order])[0] <= overlap]
    return np.array(kept, np.intp)


def size_overlaps(sizes: NDArray[np.floating], anchors: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, K) intersection over union of concentric boxes with (N, 2) and (K, 2) widths and heights, pixels."""
    common = np.minimum(sizes[:, None], anchors[None]).prod(axis=2, dtype=np.float64)
    return common / (sizes.prod(axis=1)[:, None] + anchors.prod(axis=1)[None] - common)
