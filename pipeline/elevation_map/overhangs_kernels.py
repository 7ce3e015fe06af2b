"""Compiled search of a depth image for surfaces that hide the space above the ground."""

from typing import NamedTuple

import numpy as np
from numba import njit

UNSURE, OPEN, ROOFED = np.uint8(0), np.uint8(1), np.uint8(2)
"""The space above a return: not known, seen through, or hidden in part by a nearer surface."""


class Limits(NamedTuple):
    """What counts as an overhang.

    Attributes:
        headroom: m above a return.
        nearest, farthest: m of depth between which surfaces surely give returns.
        nearer, reach, fewest: as of :class:`pipeline.elevation_map.config.OverhangConfig`.
    """

    headroom: float
    nearest: float
    farthest: float
    nearer: float
    reach: float
    fewest: int


@njit(cache=True, nogil=True)
def overhangs(points, noise, depth, pinhole, up, limits):
    """(N,) what the image shows of the space above each return: OPEN, ROOFED or UNSURE.

    Args:
        points: (N, 3) returns, m in ``camera_optical``.
        noise: (N,) m, of depths as deep as theirs.
        depth: (H, W) m, not positive without a return.
        pinhole: (4,) fx, fy, cx, cy.
        up: (3,) in ``camera_optical``.
        limits: of what counts.
    """
    result = np.full(len(points), UNSURE, np.uint8)
    for n in range(len(points)):
        if points[n] @ up < 0 < points[n, 2]:
            result[n] = _space_above(points[n], noise[n], depth, pinhole, up, limits)
    return result


@njit(cache=True)
def _space_above(point, noise, depth, pinhole, up, limits):
    """Follow the vertical line above a return through the image, pixel by pixel.

    A ray that meets the level of the return beyond the sensor's range need not return. But it also may not if an edge
    is too near for the sensor, so this counts only for returns so far away that such an overhang cannot reach them.
    """
    fx, fy, cx, cy = pinhole
    step, below, hidden, result = point[2] / fy, point @ up, 0, OPEN
    is_far = point[2] >= limits.nearest + limits.reach
    for k in range(1, int(limits.headroom / step) + 1):
        x, y, z = point[0] + k * step * up[0], point[1] + k * step * up[1], point[2] + k * step * up[2]
        u, v = int(np.floor(fx * x / z + cx)), int(np.floor(fy * y / z + cy))
        if not (0 <= u < depth.shape[1] and 0 <= v < depth.shape[0]):
            return UNSURE
        d, height = depth[v, u], below + k * step
        if d > 0:
            result = result if d >= z - noise else UNSURE
            hidden = hidden + 1 if z - limits.reach <= d < z - noise - limits.nearer else 0
        elif not (is_far and (height >= 0 or z * below / height >= limits.farthest)):
            result = UNSURE
        if hidden >= limits.fewest:
            return ROOFED
    return result
