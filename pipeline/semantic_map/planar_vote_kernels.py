"""Loops over the pixels of a frame: which plane each belongs to, and how they vote on its class."""

import numpy as np
from numba import njit

from pipeline.segments.surfels_kernels import NONE, dot, regions_around


@njit(cache=True)
def planes_of_pixels(depth, rays, of_pixel, near, region, planes, max_shift, noise, window):
    """(H, W) int32 plane of every pixel, NONE for those on none.

    Where a pixel alone could be on several planes, its neighbours in the image decide with it: noise moves a pixel by
    more than two planes are apart where they meet.

    Args:
        depth, rays, of_pixel, near, region, planes: as for ``project_pixels``.
        max_shift, noise: a pixel is on no plane that its ray meets ``max_shift + noise · depth²`` m or more away.
        window: pixels, how far away such neighbours may be.
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
    """Of the planes (P, 4) that fit the pixel ``z, ray`` the one to which a window's pixels move least in sum.

    None of them counts for more than ``limit``.
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
    """m along the optical axis from a pixel of depth ``z`` to where its ray (3,) meets the plane (4,)."""
    slope = dot(plane, ray)
    return abs(plane[3] / slope - z) if slope != 0 else np.inf


@njit(cache=True)
def possible_logs(probabilities, plane, possible, clutter, floor):
    """(N, C) float32 logarithms of probabilities after the classes that a plane cannot be of gave theirs away.

    The possible ones get them in proportion, but for ``clutter``: what leans like no wall is no likelier to be that.

    Args:
        probabilities: (N, C) float32.
        plane: (N,) int32 of every point, or NONE.
        possible: (P, C) bool, of every plane.
        clutter: the class that is not made of planes.
        floor: least probability.
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
    """(P, C) float64 mean of (N, C) float32 logarithms over the points of each plane, 0 where there are none.

    ``plane`` (N,) int32 is that of every point, or NONE; ``planes`` is P, their number.
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
    """(N, C) float32: exp(``logs`` + ``evidence`` of the plane), divided by its sum; points on none keep theirs.

    Args:
        probabilities, logs: (N, C) float32, and their logarithms.
        evidence: (P, C) float64, logarithms.
        plane: (N,) int32 of every point, or NONE.
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
