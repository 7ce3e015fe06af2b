"""Compiled loops over the pixels of a frame: the plane of each pixel, and the vote on each plane's class."""

import numpy as np
from numba import njit

from pipeline.segments.surfels_kernels import NONE, dot, regions_around


@njit(cache=True)
def planes_of_pixels(depth, rays, of_pixel, near, region, planes, max_shift, noise, window):
    """(H, W) int32 index of the plane of every pixel, NONE for pixels on no plane.

    If a pixel fits several planes, its neighbours in the image help to decide. Near the line where two planes meet,
    noise shifts a pixel by more than the distance between the planes.

    Args:
        depth, rays, of_pixel, near, region, planes: as for ``project_pixels``.
        max_shift, noise: a pixel fits a plane if its ray meets the plane at a depth that differs from the pixel's by
            less than ``max_shift + noise · depth²`` m.
        window: maximum distance of these neighbours in rows and columns.
    """
    choices = regions_around(near, region)
    result = np.full(depth.shape, NONE, np.int32)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            if of_pixel[v, u] == NONE:
                continue
            z, around = depth[v, u], choices[of_pixel[v, u]]
            limit, fitting = max_shift + noise * z * z, 0
            for p in around:
                if p != NONE and shift(z, rays[v, u], planes[p]) < limit:
                    fitting += 1
                    result[v, u] = p
            if fitting > 1:
                rows = slice(max(v - window, 0), v + window + 1)
                columns = slice(max(u - window, 0), u + window + 1)
                result[v, u] = nearest_plane(
                    depth[rows, columns], rays[rows, columns], z, rays[v, u], around, planes, limit
                )
    return result


@njit(cache=True)
def nearest_plane(depth, rays, z, ray, choices, planes, limit):
    """The plane, of the ``choices`` of ``planes`` (P, 4) that fit a pixel ``z, ray``, with the least sum of shifts.

    The sum is over the pixels of a window; the shift of each pixel to the plane is limited to ``limit`` m.
    """
    least, nearest = np.inf, NONE
    for p in choices:
        if p == NONE or not shift(z, ray, planes[p]) < limit:
            continue
        total = 0.0
        for v in range(depth.shape[0]):
            for u in range(depth.shape[1]):
                if depth[v, u] > 0:
                    total += min(shift(depth[v, u], rays[v, u], planes[p]), limit)
        if total < least:
            least, nearest = total, p
    return nearest


@njit(cache=True, inline="always")
def shift(z, ray, plane):
    """Distance along the optical axis from a pixel at depth ``z`` to where its ray (3,) meets the plane (4,), m."""
    slope = dot(plane, ray)
    return abs(plane[3] / slope - z) if slope != 0 else np.inf


@njit(cache=True)
def log_probabilities_of_possible(probabilities, plane, possible, clutter, floor):
    """(N, C) float32 log probabilities, after moving the probabilities of impossible classes to possible ones.

    The possible classes gain in proportion to their probabilities, except ``clutter``, because a plane that cannot be
    a wall need not be clutter.

    Args:
        probabilities: (N, C) float32.
        plane: (N,) int32 plane of every point, or NONE.
        possible: (P, C) bool, the possible classes of every plane.
        clutter: index of the class clutter, which does not consist of planes.
        floor: lower limit of the probabilities.
    """
    logs = np.log(np.maximum(probabilities, np.float32(floor)))
    for i in range(len(logs)):
        if plane[i] == NONE:
            continue
        kept, lost = 0.0, 0.0
        for c in range(logs.shape[1]):
            if not possible[plane[i], c]:
                lost += probabilities[i, c]
                logs[i, c] = -np.inf
            elif c != clutter:
                kept += max(probabilities[i, c], floor)
        for c in range(logs.shape[1]):
            if c != clutter:
                logs[i, c] += np.log((kept + lost) / kept)
    return logs


@njit(cache=True)
def mean_logs(logs, plane, planes):
    """(P, C) float64 mean of (N, C) float32 logarithms over the points of each plane, 0 for a plane without points.

    ``plane`` (N,) int32 is the plane of every point, or NONE; ``planes`` is P, the number of planes.
    """
    sums, counts = np.zeros((planes, logs.shape[1])), np.zeros(planes, np.int64)
    for i in range(len(logs)):
        if plane[i] != NONE:
            counts[plane[i]] += 1
            for c in range(logs.shape[1]):
                sums[plane[i], c] += logs[i, c]
    for p in range(planes):
        sums[p] /= max(counts[p], 1)
    return sums


@njit(cache=True)
def normalised_products(probabilities, logs, evidence, plane):
    """(N, C) float32: normalised exp(``logs`` + the plane's ``evidence``); ``probabilities`` for points on no plane.

    Args:
        probabilities, logs: (N, C) float32, and :func:`log_probabilities_of_possible` of them.
        evidence: (P, C) float64 logarithms for every plane.
        plane: (N,) int32 plane of every point, or NONE.
    """
    result = probabilities.copy()
    for i in range(len(logs)):
        if plane[i] == NONE:
            continue
        total = 0.0
        for c in range(logs.shape[1]):
            result[i, c] = np.exp(logs[i, c] + evidence[plane[i], c])
            total += result[i, c]
        for c in range(logs.shape[1]):
            result[i, c] /= total
    return result
