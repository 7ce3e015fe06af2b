"""Anchors fitted to data: k-means by overlap (Redmon and Farhadi, YOLO9000, arXiv:1612.08242, section 2)."""

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

_ROUNDS = 300


def fit_anchors(sizes: NDArray[np.floating], count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(count, 2) widths and heights, from small to large, that overlap (N, 2) sizes well.

    Raises:
        InputError: fewer different sizes than anchors.
    """
    different = np.unique(sizes, axis=0)
    if len(different) < count:
        raise InputError(f"{len(different)} boxes of different size: too few to fit {count} anchors to")
    anchors = rng.choice(different, count, replace=False).astype(np.float64)
    nearest = np.full(len(sizes), -1)
    for _ in range(_ROUNDS):
        before, nearest = nearest, size_overlaps(sizes, anchors).argmax(axis=1)
        if (nearest == before).all():
            break
        for index in np.unique(nearest):
            anchors[index] = np.median(sizes[nearest == index], axis=0)
    return anchors[np.argsort(anchors.prod(axis=1), kind="stable")]


def size_overlaps(sizes: NDArray[np.floating], anchors: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, K) intersection over union of (N, 2) and (K, 2) boxes that lie in the same place."""
    common = np.minimum(sizes[:, None], anchors[None]).prod(axis=2, dtype=np.float64)
    return common / (sizes.prod(axis=1)[:, None] + anchors.prod(axis=1)[None] - common)
