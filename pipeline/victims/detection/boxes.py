"""Boxes as rows of x0, y0, x1, y1 in pixels: decoding, overlap, suppression, and anchors."""

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.special import expit, logit

from pipeline.errors import InputError
from pipeline.victims.detection.darknet_cfg import OBJECTNESS, YoloHead

LARGEST_EXPONENT = 20.0
"""Bound of the exponent that scales an anchor: no box in an image is so large, and its square still fits float32."""


def decode(
    head: NDArray[np.float32], yolo: YoloHead, width: int, height: int, threshold: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Boxes of one scale, by the equations of section 2.1 of YOLOv3, or of Scaled-YOLOv4 (arXiv:2011.08036).

    Args:
        head: (anchors · (5 + classes), H, W) input of [yolo].
        yolo: the [yolo] layer of the scale.
        width, height: of the network's input, pixels.
        threshold: least objectness, greater than 0.

    Returns:
        (N, 4) boxes in the network's input, pixels, and (N, classes) objectness times class probability.
    """
    rows, columns = head.shape[1:]
    cells = head.reshape(len(yolo.mask), -1, rows, columns)
    anchor, y, x = np.nonzero(cells[:, OBJECTNESS] >= (threshold if yolo.new_coords else logit(threshold)))
    found = cells[anchor, :, y, x]
    shares = found if yolo.new_coords else expit(found)
    in_cell = (shares[:, :2] - 1 / 2) * yolo.scale_x_y + 1 / 2
    middle = (in_cell + np.stack([x, y], axis=1)) * (width / columns, height / rows)
    sizes = np.array(yolo.anchors)[list(yolo.mask)][anchor]
    grown = np.exp(np.minimum(found[:, 2:OBJECTNESS], LARGEST_EXPONENT))
    if yolo.new_coords:
        grown = np.square(2 * found[:, 2:OBJECTNESS])
    boxes = np.concatenate([middle - grown * sizes / 2, middle + grown * sizes / 2], axis=1)
    return boxes.astype(np.float32), shares[:, OBJECTNESS + 1 :] * shares[:, OBJECTNESS, None]


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
    """(M,) indices, the best first, of the (N, 4) boxes that overlap no kept box of a higher score (N,) by more.

    Greedy non-maximum suppression; ``overlap`` is intersection over union. Only the ``most`` best are considered.
    """
    order = np.argsort(-scores, kind="stable")[:most]
    kept: list[int] = []
    while len(order):
        best, order = order[0], order[1:]
        kept.append(best)
        order = order[overlaps(boxes[[best]], boxes[order])[0] <= overlap]
    return np.array(kept, np.intp)


def size_overlaps(sizes: NDArray[np.floating], anchors: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, K) intersection over union of boxes with (N, 2) and (K, 2) widths and heights, px, at the same place."""
    common = np.minimum(sizes[:, None], anchors[None]).prod(axis=2, dtype=np.float64)
    return common / (sizes.prod(axis=1)[:, None] + anchors.prod(axis=1)[None] - common)


def fit_anchors(sizes: NDArray[np.floating], count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(count, 2) widths and heights, px, from small to large, that overlap (N, 2) sizes well.

    By k-means, as in YOLO9000 (Redmon and Farhadi, arXiv:1612.08242, section 2), of the sizes' logarithms: boxes
    overlap well whose sizes have a ratio near 1.

    Raises:
        InputError: fewer different sizes than anchors.
    """
    different = np.unique(sizes, axis=0)
    if len(different) < count:
        raise InputError(f"{len(different)} boxes of different size: too few to fit {count} anchors to")
    anchors = np.exp(kmeans2(np.log(sizes), count, minit="++", rng=rng)[0])
    return anchors[np.argsort(anchors.prod(axis=1), kind="stable")]
