"""How much better the depth returns of a detection agree with what it claims to be than with background.

One Bayes factor of extents, height, and the share of the box that they fill, for every kind of find. An object shows
any part of each of its extents, which are log-normal; those of background have no scale: their logarithm is uniform.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, log

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from pipeline.geometry.parts import parts

THIN = 0.02
"""m, noise of a depth camera at its usual range; nothing seems thinner."""
EXTENTS: dict[str, tuple[tuple[float, float, float], ...]] = {
    "victim": ((1.7, 0.5, 0.25), (0.9, 0.7, 0.5), (0.45, 0.2, 0.14)),
    "hazmat_sign": ((0.2, 0.2, THIN),),
    "fire_extinguisher": ((0.45, 0.16, 0.14),),
    "door_lever": ((0.22, 0.14, 0.06),),
}
"""m, medians of an object's extents, the longest first, by kind.

People who stand or lie: stature, shoulder breadth, chest depth; who sit: sitting height, half of it and a thigh
before them, shoulder breadth (NASA-STD-3000, section 3.3); dolls and extinguishers: as the RoboCup Rescue arena
designer has them; levers with their plates; labels: as the leagues print them, 0.1 to 0.3 m. What codes say needs no
such check.
"""
SPREAD = log(1.5) / 2
"""Standard deviation of an extent's logarithm: 95 % lie within a factor of 1.5."""
HIGHEST = 2.0
"""m over the ground up to which people lie and stand, and signs hang; background is up to twice as high and long."""


@dataclass(frozen=True, eq=False)
class Weighed:
    """How well the returns of a detection agree with what it claims to be.

    Attributes:
        log_ratio: natural logarithm of the Bayes factor against background; −∞ without returns.
        belongs: (N,) bool, the returns that are the object's own.
    """

    log_ratio: float
    belongs: NDArray[np.bool_]


def weigh(
    kind: str,
    points: NDArray[np.floating],
    ground: float,
    background: NDArray[np.bool_] | None = None,
    camera: NDArray[np.float64] | None = None,
) -> Weighed:
    """Weigh the returns in a detection's box, or all points of a find, against what it claims to be.

    Args:
        kind: a key of EXTENTS.
        points: (N, 3) m in ``map``.
        ground: height of the ground, m in ``map``.
        background: (N,) bool, returns of something else, such as a wall.
        camera: (3,) position of the camera, m in ``map``, if all are returns in a box of its image.
    """
    free = np.ones(len(points), np.bool_) if background is None else ~background
    best = Weighed(-inf, np.zeros(len(points), np.bool_))
    in_box = None if camera is None or not free.any() else _in_box(points, camera)
    for extents in EXTENTS[kind]:
        for part in _parts(points, free, extents[1] / 2):
            ratio = _of_shape(points[part], extents, ground) - log(len(EXTENTS[kind]))
            if in_box is not None:
                # Both shares are uniform for background. That of the returns is triangular for an object; that of the
                # area, which a box fits on four sides, is as the greatest of four uniform ones.
                spanned = max(np.ptp(in_box[part], axis=0).prod(), 1 / len(points))
                ratio += log(2 * part.mean()) + log(4) + 3 * log(spanned)
            if ratio > best.log_ratio:
                best = Weighed(ratio, part)
    return best


def _of_shape(points: NDArray[np.floating], extents: tuple[float, float, float], ground: float) -> float:
    """Log ratio by the extents and the height of a part of the points, for an object of these extents."""
    seen = np.maximum(extents_of(points), THIN)
    # E[1/F; F > e] for a log-normal full extent F and a visible one e, over 1 / (e · log range) of the background.
    sizes = np.log(seen / extents) + SPREAD**2 / 2 + log(log(2 * HIGHEST / THIN))
    sizes += log_ndtr((np.log(extents / seen) - SPREAD**2) / SPREAD)
    above = float(np.median(points[:, 2])) - ground
    return float(sizes.sum() + log(2) + log_ndtr((HIGHEST - above) / SPREAD))


def _in_box(points: NDArray[np.floating], camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) where the points (N, 3) lie in their box as seen by a camera (3,), as shares of its width and height."""
    rays = points - camera
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    middle = rays.mean(axis=0)
    right = np.cross(middle, [0.0, 0.0, 1.0])
    seen = rays @ np.stack([right, np.cross(right, middle)], axis=1)
    return (seen - seen.min(axis=0)) / np.maximum(np.ptp(seen, axis=0), np.finfo(np.float64).eps)


def extents_of(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """(3,) extents, m, the longest first, of (N, 3) points along their principal axes, without 5 % at each end."""
    middle = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(middle.T.astype(np.float64) @ middle)
    return -np.sort(-np.subtract(*np.percentile(middle @ axes, [95, 5], axis=0)))


def _parts(points: NDArray[np.floating], free: NDArray[np.bool_], gap: float) -> Iterator[NDArray[np.bool_]]:
    """(N,) bool for each part of the ``free`` points (N, 3), which are apart by about ``gap``, m."""
    if not free.any():
        return
    part_of = np.zeros(len(points), np.int64)
    part_of[free] = parts(points[free], gap)
    for number in range(1, part_of.max() + 1):
        yield part_of == number
