"""Compiled search of a depth image for surfaces that hide the space above the ground."""

from typing import NamedTuple

import numpy as np
from numba import njit

UNSURE, OPEN, ROOFED = np.uint8(0), np.uint8(1), np.uint8(2)
"""The space above a return: unknown, seen through, or partly hidden by a nearer surface."""


class Limits(NamedTuple):
    """Limits that define an overhang.

    Attributes:
        headroom: height above a return up to which overhangs matter, m.
        nearest, farthest: depths between which surfaces reliably give returns, m.
        min_depth_difference, max_overhang, min_pixels, min_side_extent, min_sill_height: the constants of
            :mod:`pipeline.elevation_map.ground_evidence` of the same names.
    """

    headroom: float
    nearest: float
    farthest: float
    min_depth_difference: float
    max_overhang: float
    min_pixels: int
    min_side_extent: float
    min_sill_height: float


@njit(cache=True, nogil=True)
def states_above(points, noise, depth, pinhole, up, limits):
    """(N,) uint8 state of the space above each return: OPEN, ROOFED or UNSURE.

    Args:
        points: (N, 3) returns, m in ``camera_optical``.
        noise: (N,) margin for the noise of the returns' depths, m.
        depth: (H, W) m, depth image; not positive where there is no return.
        pinhole: (4,) intrinsics fx, fy, cx, cy, pixels.
        up: (3,) unit vector that points up, in ``camera_optical``.
        limits: the limits that define an overhang.
    """
    result = np.full(len(points), UNSURE, np.uint8)
    for n in range(len(points)):
        if points[n] @ up < 0 < points[n, 2]:
            result[n] = _state_above(points[n], noise[n], depth, pinhole, up, limits)
    return result


@njit(cache=True)
def _state_above(point, noise, depth, pinhole, up, limits):
    """The state of the space above a return, from the pixels along the vertical line above the return.

    A ray that meets the level of the return only beyond the sensor's range is expected to give no return. An edge too
    close to the sensor gives no return either, so such a ray is evidence of free space only above returns too far
    away to be overhung by the edge.
    """
    fx, fy, cx, cy = pinhole
    step, below, hidden, result = point[2] / fy, point @ up, 0, OPEN
    is_far = point[2] >= limits.nearest + limits.max_overhang
    for k in range(1, int(limits.headroom / step) + 1):
        x, y, z = point[0] + k * step * up[0], point[1] + k * step * up[1], point[2] + k * step * up[2]
        u, v = int(np.floor(fx * x / z + cx)), int(np.floor(fy * y / z + cy))
        if not (0 <= u < depth.shape[1] and 0 <= v < depth.shape[0]):
            return UNSURE
        d, height = depth[v, u], below + k * step
        if d > 0:
            result = result if d >= z - noise else UNSURE
            hidden = hidden + 1 if _hides(d, z, noise, limits) else 0
        elif not (is_far and (height >= 0 or z * below / height >= limits.farthest)):
            result = UNSURE
        if (
            d > 0
            and hidden >= limits.min_pixels
            and _extends_to_both_sides(point, noise, depth, pinhole, (u, v), z, limits)
        ):
            return UNSURE if _has_sill(point, noise, depth, pinhole, (u, v), up, limits) else ROOFED
    return result


@njit(cache=True)
def _hides(d, z, noise, limits):
    """Whether a return at depth ``d``, m, hides the space at depth ``z``, m, not too far behind it."""
    return z - limits.max_overhang <= d < z - noise - limits.min_depth_difference


@njit(cache=True)
def _extends_to_both_sides(point, noise, depth, pinhole, pixel, z, limits):
    """Whether the surface that hides the space above a return extends to both sides without hiding the ground there.

    Next to the upright edge of a wall or post, a tilted camera sees the ground, and above it the wall.
    """
    fx, fy, cx, cy = pinhole
    u, v = pixel
    foot_u, foot_v = int(np.floor(fx * point[0] / point[2] + cx)), int(np.floor(fy * point[1] / point[2] + cy))
    for side in (-1, 1):
        above = u + side * int(np.ceil(limits.min_side_extent * fx / depth[v, u]))
        foot = foot_u + side * int(np.ceil(limits.min_side_extent * fx / point[2]))
        if not (0 <= above < depth.shape[1] and 0 <= foot < depth.shape[1] and 0 <= foot_v < depth.shape[0]):
            return False
        d, ground = depth[v, above], depth[foot_v, foot]
        if not (d > 0 and _hides(d, z, noise, limits)) or 0 < ground < point[2] - noise - limits.min_depth_difference:
            return False
    return True


@njit(cache=True)
def _has_sill(point, noise, depth, pinhole, pixel, up, limits):
    """Whether the surface that hides the space above a return continues below the return, like a wall around a hole.

    The image is followed from the return, away from the ``pixel`` that hides the space. Where the horizontal distance
    is the same as at this pixel, a wall continues straight down, but ground does not.
    """
    fx, fy, cx, cy = pinhole
    u, v = fx * point[0] / point[2] + cx, fy * point[1] / point[2] + cy
    du, dv = u - pixel[0], v - pixel[1]
    length = np.hypot(du, dv)
    if length < 1:  # A camera that points straight down sees no wall below a hole
        return False
    _, edge = _height_and_distance(pixel[0], pixel[1], depth[pixel[1], pixel[0]], pinhole, up)
    margin, top = noise + limits.min_depth_difference, -np.inf
    while True:
        u, v = u + du / length, v + dv / length
        if not (0 <= u < depth.shape[1] and 0 <= v < depth.shape[0]):
            return False
        d = depth[int(v), int(u)]
        height, distance = _height_and_distance(u, v, d, pinhole, up)
        if d > 0 and distance < edge - margin:
            return False
        if d > 0 and distance <= edge + margin:
            top = max(top, height)
            if height < top - limits.min_sill_height:
                return True


@njit(cache=True, inline="always")
def _height_and_distance(u, v, d, pinhole, up):
    """Height above the camera and horizontal distance from the camera of the return at a pixel, m.

    ``d``: depth of the return, m.
    """
    fx, fy, cx, cy = pinhole
    x, y = d * (u - cx) / fx, d * (v - cy) / fy
    height = x * up[0] + y * up[1] + d * up[2]
    return height, np.sqrt(max(x * x + y * y + d * d - height * height, 0.0))
