"""People cut out of one image and pasted into another (Ghiasi et al., arXiv:2012.07177)."""

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.victims.detection.labelled_image import LabelledImage

HIDDEN = 0.6
"""Share of a box that is pasted over, above which its person is ignored."""


def pasted(
    canvas: LabelledImage, donor: LabelledImage, ratio: float, rng: np.random.Generator
) -> LabelledImage:
    """The canvas and on it, somewhere, the donor's people, ``ratio`` times as large; alone if they do not fit.

    Edges are hard, as the renderer's are.
    """
    if donor.shown is None or len(donor.boxes) == 0:
        return canvas
    x0, y0 = np.floor(donor.boxes[:, :2].min(axis=0)).astype(int)
    x1, y1 = np.ceil(donor.boxes[:, 2:].max(axis=0)).astype(int)
    width, height = max(1, round((x1 - x0) * ratio)), max(1, round((y1 - y0) * ratio))
    rows, columns = canvas.rgb.shape[:2]
    if width > columns or height > rows:
        return canvas
    left, top = int(rng.integers(columns - width + 1)), int(rng.integers(rows - height + 1))
    shown = donor.shown[y0:y1, x0:x1].astype(np.uint8)
    cut_out = cv2.resize(shown, (width, height), interpolation=cv2.INTER_NEAREST) > 0
    people = cv2.resize(donor.rgb[y0:y1, x0:x1], (width, height))
    rgb, over = canvas.rgb.copy(), np.zeros((rows, columns), np.bool_)
    over[top : top + height, left : left + width] = cut_out
    rgb[over] = people[cut_out]
    factors = np.tile([width / (x1 - x0), height / (y1 - y0)], 2)
    moved = (donor.boxes - np.tile([x0, y0], 2)) * factors + np.tile([left, top], 2)
    hidden = np.array([_share(over, box) > HIDDEN for box in canvas.boxes], np.bool_)
    return LabelledImage(
        rgb,
        np.concatenate([canvas.boxes, moved]).astype(np.float32),
        np.concatenate([canvas.ignored | hidden, donor.ignored]),
    )


def _share(over: NDArray[np.bool_], box: NDArray[np.float32]) -> float:
    """Of a box's pixels that are covered."""
    x0, y0, x1, y1 = box.round().astype(int)
    inside = over[y0:y1, x0:x1]
    return float(inside.mean()) if inside.size else 0.0
