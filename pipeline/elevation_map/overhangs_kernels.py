"""Compiled search of a depth image for surfaces that hide the space above the ground."""

import numpy as np
from numba import njit

UNSURE, OPEN, ROOFED, DISTANT = np.uint8(0), np.uint8(1), np.uint8(2), np.uint8(3)
"""The space above a return: not seen as a whole, seen through, hidden in part by a nearer surface, or seen through as
far as surfaces give returns."""


@njit(cache=True, nogil=True)
def overhangs(points, noise, depth, pinhole, up, headroom, far, nearer, fewest):
    """(N,) what the image shows of the space above each return: OPEN, ROOFED, DISTANT or UNSURE.

    Args:
        points: (N, 3) returns, m in ``camera_optical``.
        noise: (N,) m, of depths as deep as theirs.
        depth: (H, W) m, not positive without a return.
        pinhole: (4,) fx, fy, cx, cy.
        up: (3,) in ``camera_optical``.
        headroom: m above a return.
        far: m, up to which surfaces surely give returns.
        nearer: m, besides the noise, by which a surface must be nearer than the space that it hides.
        fewest: pixels that must show it.
    """
    result = np.full(len(points), UNSURE, np.uint8)
    for n in range(len(points)):
        if points[n] @ up < 0 < points[n, 2]:
            result[n] = _space_above(points[n], noise[n], depth, pinhole, up, headroom, far, nearer, fewest)
    return result


@njit(cache=True)
def _space_above(point, noise, depth, pinhole, up, headroom, far, nearer, fewest):
    """Follow the vertical line above a return through the image, pixel by pixel."""
    fx, fy, cx, cy = pinhole
    step, below, hidden, result = point[2] / fy, point @ up, 0, OPEN
    for k in range(1, int(headroom / step) + 1):
        x, y, z = point[0] + k * step * up[0], point[1] + k * step * up[1], point[2] + k * step * up[2]
        u, v = int(np.floor(fx * x / z + cx)), int(np.floor(fy * y / z + cy))
        if not (0 <= u < depth.shape[1] and 0 <= v < depth.shape[0]):
            break
        d, height = depth[v, u], below + k * step
        if d > 0:
            hidden = hidden + 1 if d < z - noise - nearer else 0
            result = result if d >= z - noise else UNSURE
        elif height >= 0 or z * below / height >= far:
            result = result if result == UNSURE else DISTANT
        else:
            result = UNSURE
        if hidden >= fewest:
            return ROOFED
    return result
