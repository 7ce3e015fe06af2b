"""Bayes factors: how much better the depth returns of a detection agree with its kind than with background.

For every kind of find, one Bayes factor combines the extents of the returns, their height, their fraction of all
returns in the box, and the fraction of the box that they span. An object may show any part of each of its extents,
which are log-normal; the extents of background are scale-free, with uniform logarithms.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf, log

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from pipeline.arrays import Mask, PixelMask, Points, Values
from pipeline.geometry.parts import part_numbers
from pipeline.tracks.config import Extents

MIN_EXTENT = 0.02
"""Noise of a depth camera at its usual range, m, and thus the minimum of a visible extent."""
EXTENT_SIGMA = log(1.5) / 2
"""Standard deviation of the logarithm of an extent of a kind: 95% lie within a factor of 1.5 of the median."""
MAX_HEIGHT = 2.0
"""Maximum height above the ground of people and signs, m; background is up to twice as high and long."""


@dataclass(frozen=True, eq=False)
class ShapeMatch:
    """How well the returns of a detection agree with its kind.

    Attributes:
        log_ratio: natural logarithm of the Bayes factor against background; −∞ without returns.
        belongs: which returns belong to the object.
    """

    log_ratio: float
    belongs: Mask


def weigh(
    extents: Sequence[Extents],
    points: Points,
    ground: float,
    background: Mask | None = None,
    in_box: NDArray[np.float64] | None = None,
) -> ShapeMatch:
    """Weigh whether the returns in a detection's box, or all points of a find, are of a kind or of background.

    Args:
        extents: median extents of each form of the kind, m.
        points: points of the detection or the find.
        ground: height of the ground, m in ``map``.
        background: which points are returns of something else, such as a wall.
        in_box: (N, 2) positions of the points in the detection's box, as fractions of its sides; None if the points
            are not those of one detection.
    """
    free = np.ones(len(points), np.bool_) if background is None else ~background
    best = ShapeMatch(-inf, np.zeros(len(points), np.bool_))
    for form in extents:
        for part in _parts(points, free, form[1] / 2):
            ratio = _log_bayes_factor(points[part], form, ground) - log(len(extents))
            if in_box is not None:
                # For background, the part's fractions of the returns in the box and of the box's area are uniformly
                # distributed. For an object, the fraction of the returns has a triangular distribution. The fraction
                # of the area is distributed like the maximum of four uniform variables, since a box fits on four
                # sides.
                spanned = max(np.ptp(in_box[part], axis=0).prod(), 1 / len(points))
                ratio += log(2 * part.mean()) + log(4) + 3 * log(spanned)
            if ratio > best.log_ratio:
                best = ShapeMatch(ratio, part)
    return best


def _log_bayes_factor(points: Points, extents: Extents, ground: float) -> float:
    """Log Bayes factor from the extents and the height of a part's points, for an object with these extents."""
    seen = np.maximum(extents_of(points), MIN_EXTENT)
    # E[1/F; F > e] for a log-normal full extent F and a visible extent e, divided by the background's density,
    # 1 / (e · log range).
    sizes = np.log(seen / extents) + EXTENT_SIGMA**2 / 2 + log(log(2 * MAX_HEIGHT / MIN_EXTENT))
    sizes += log_ndtr((np.log(extents / seen) - EXTENT_SIGMA**2) / EXTENT_SIGMA)
    above = float(np.median(points[:, 2])) - ground
    return float(sizes.sum() + log(2) + log_ndtr((MAX_HEIGHT - above) / EXTENT_SIGMA))


def relative_positions(pixels: PixelMask, box: PixelMask) -> NDArray[np.float64]:
    """(N, 2) positions of pixels in the bounding box of the pixels ``box``, as fractions of its two sides."""
    in_box = np.argwhere(box)
    first, last = in_box.min(axis=0), in_box.max(axis=0)
    return (np.argwhere(pixels) - first) / np.maximum(last - first, 1)


def extents_of(points: Points) -> Values:
    """Three extents of points along their principal axes, the longest first, m, without the outer 5% at each end."""
    middle = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(middle.T.astype(np.float64) @ middle)
    return -np.sort(-np.subtract(*np.percentile(middle @ axes, [95, 5], axis=0)))


def _parts(points: Points, free: Mask, gap: float) -> Iterator[Mask]:
    """Yield masks of the parts into which the ``free`` points fall; parts are separated by about ``gap`` m."""
    if not free.any():
        return
    part_of = np.zeros(len(points), np.int64)
    part_of[free] = part_numbers(points[free], gap)
    for number in range(1, part_of.max() + 1):
        yield part_of == number
