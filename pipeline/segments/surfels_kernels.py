"""Loops over the pixels of a frame, which reduce the frame to surfels and project pixels onto planes."""

import numpy as np
from numba import njit

NONE = -1
"""Index meaning no surfel, neighbour, region or plane."""


@njit(cache=True)
def make_surfels(depth, labels, rays, block, min_pixels, min_step, deviations):
    """Make surfels: the mean points of the pixels of each label in each block of the image.

    If a label in a block covers two surfaces, one behind the other, each surface gives a surfel.

    Args:
        depth: (H, W) float32 m.
        labels: (H, W) uint8, 0 for pixels to leave out.
        rays: (H, W, 3) float32, points at depth 1.
        block: edge length of a block, pixels.
        min_pixels: minimum number of pixels of a surfel.
        min_step: minimum difference between the mean inverse depths of two surfaces one behind the other, 1/m.
        deviations: minimum difference between these means, in standard deviations within a surface.

    Returns:
        (N, 3) float32 points in ``camera_optical``, (N,) uint8 labels, (N, 2) int32 row and column of their
        blocks, in row-major order, and (H, W) int32, the surfel of every pixel or NONE.
    """
    height, width = depth.shape
    of_pixel = np.full((height, width), NONE, np.int32)
    room = depth.size // min_pixels + 1
    points, surfel_labels = np.empty((room, 3), np.float32), np.empty(room, np.uint8)
    blocks = np.empty((room, 2), np.int32)
    count = 0
    for row in range(0, height, block):
        for column in range(0, width, block):
            rows, columns = slice(row, row + block), slice(column, column + block)
            z, of, r = depth[rows, columns], labels[rows, columns], rays[rows, columns]
            present = np.zeros(256, np.int64)
            for label in of.flat:
                present[label] += 1
            for label in np.flatnonzero(present[1:] >= min_pixels) + 1:
                parting = parting_inverse_depth(z, of, label, min_step, deviations)
                for near in (True, False):
                    pixels, mean = mean_point(z, of, r, label, parting, near)
                    if pixels >= min_pixels:
                        assign(of_pixel[rows, columns], z, of, label, parting, near, count)
                        points[count], surfel_labels[count] = mean, label
                        blocks[count] = row // block, column // block
                        count += 1
    return points[:count], surfel_labels[:count], blocks[:count], of_pixel


@njit(cache=True)
def parting_inverse_depth(depth, labels, label, min_step, deviations):
    """The inverse depth, 1/m, that separates two surfaces of one label in a block (h, w), or 0 if there is only one.

    The block is split at the middle of the label's range of inverse depths. The means of the two parts must differ by
    more than ``min_step`` and by more than ``deviations`` standard deviations.
    """
    low, high = np.inf, 0.0
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            if labels[v, u] == label:
                q = 1 / np.float64(depth[v, u])
                low, high = min(low, q), max(high, q)
    parting = (low + high) / 2
    n, s, ss = np.zeros(2), np.zeros(2), np.zeros(2)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            if labels[v, u] == label:
                q = 1 / np.float64(depth[v, u]) - parting
                half = int(q > 0)
                n[half] += 1
                s[half] += q
                ss[half] += q * q
    if n.min() == 0:
        return 0.0
    mean = s / n
    step, variance = mean[1] - mean[0], (ss - s * mean).sum() / n.sum()
    return parting if step > min_step and step * step > deviations * deviations * variance else 0.0


@njit(cache=True)
def mean_point(depth, labels, rays, label, parting, near):
    """Number and mean (3,), m, of a label's points in front of (``near``) or behind the inverse depth ``parting``."""
    n, x, y, z = 0, 0.0, 0.0, 0.0
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            if labels[v, u] == label and (1 / np.float64(depth[v, u]) > parting) == near:
                x += rays[v, u, 0] * depth[v, u]
                y += rays[v, u, 1] * depth[v, u]
                z += depth[v, u]
                n += 1
    n_or_1 = max(n, 1)
    return n, (x / n_or_1, y / n_or_1, z / n_or_1)


@njit(cache=True)
def assign(of_pixel, depth, labels, label, parting, near, surfel):
    """Write ``surfel`` to the pixels (h, w) that ``mean_point`` averaged."""
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            if labels[v, u] == label and (1 / np.float64(depth[v, u]) > parting) == near:
                of_pixel[v, u] = surfel


@njit(cache=True)
def neighbours(blocks, columns, labels, points, reach, max_step):
    """(N, K) int32, K = 2·(2·reach + 1)²: every surfel's neighbours of the same label, up to ``reach`` blocks away.

    Rows are padded with NONE. Surfels are not neighbours if their distance exceeds the product of ``max_step``, the
    smaller depth and their distance in blocks.

    Args:
        blocks, labels, points: as ``make_surfels`` returns them.
        columns: a number greater than any block's column.
        reach: maximum distance along rows and columns, blocks.
        max_step: maximum distance between surfels one block apart, m per m of depth.
    """
    number = blocks[:, 0] * columns + blocks[:, 1]
    result = np.full((len(blocks), 2 * (2 * reach + 1) ** 2), NONE, np.int32)
    for i in range(len(blocks)):
        row, column = blocks[i]
        left, right = max(column - reach, 0), min(column + reach, columns - 1)
        found = 0
        for r in range(row - reach, row + reach + 1):
            first, end = np.searchsorted(number, np.array((r * columns + left, r * columns + right + 1)))
            for j in range(first, end):
                if labels[j] != labels[i] or j == i or found == result.shape[1]:
                    continue
                steps = max(abs(r - row), abs(blocks[j, 1] - column), 1)
                if distance(points[i], points[j]) <= max_step * steps * min(points[i, 2], points[j, 2]):
                    result[i, found] = j
                    found += 1
    return result


@njit(cache=True, inline="always")
def distance(a, b):
    """Distance between two points (3,), m."""
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True)
def project_pixels(depth, rays, T_target_camera, of_pixel, near, region, planes, stride, max_shift, noise):
    """The points where the rays of pixels meet the pixels' planes.

    The noise of a depth camera moves points along their rays; projecting the points onto a plane removes the noise. A
    pixel is assigned to the plane with the smallest shift among the planes of the pixel's surfel and of the surfel's
    neighbours.

    Args:
        depth: (H, W) float32 m.
        rays: (H, W, 3) float32, points at depth 1.
        T_target_camera: 4×4 pose of the camera in the target frame.
        of_pixel: (H, W) int32, the surfel of every pixel or NONE.
        near: (N, K) int32 neighbours of every surfel, padded with NONE.
        region: (N,) int32, the plane of every surfel or NONE.
        planes: (P, 4) float64 rows [n, d] in ``camera_optical``.
        stride: step between the pixels that are projected, along rows and columns.
        max_shift, noise: pixels that would move by ``max_shift + noise · depth²`` m or more along the optical axis
            are left out.

    Returns:
        (M, 3) float32 points in the target frame, their (M,) int32 planes and (M,) int32 surfels.
    """
    choices = regions_around(near, region)
    room = (depth.shape[0] // stride + 1) * (depth.shape[1] // stride + 1)
    points, of_point = np.empty((room, 3), np.float32), np.empty(room, np.int32)
    surfels = np.empty(room, np.int32)
    count = 0
    for v in range(0, depth.shape[0], stride):
        for u in range(0, depth.shape[1], stride):
            surfel = of_pixel[v, u]
            if surfel == NONE:
                continue
            z = depth[v, u]
            least = limit = max_shift + noise * z * z
            meeting = 0.0
            for r in choices[surfel]:
                if r == NONE:
                    break
                slope = dot(planes[r], rays[v, u])
                offset = abs(planes[r, 3] - slope * z)
                if offset < least * abs(slope):
                    least = offset / abs(slope)
                    meeting, of_point[count], surfels[count] = planes[r, 3] / slope, r, surfel
            if least < limit:
                for row in range(3):
                    T = T_target_camera[row]
                    points[count, row] = dot(T, rays[v, u]) * meeting + T[3]
                count += 1
    return points[:count], of_point[:count], surfels[:count]


@njit(cache=True)
def regions_around(near, region):
    """(N, 4) int32: up to four regions of every surfel and its neighbours, the surfel's first, padded with NONE."""
    result = np.full((len(near), 4), NONE, np.int32)
    for i in range(len(near)):
        found = 0
        if region[i] != NONE:
            result[i, 0], found = region[i], 1
        for j in near[i]:
            if j == NONE or found == 4:
                break
            if region[j] != NONE and not (result[i, :found] == region[j]).any():
                result[i, found] = region[j]
                found += 1
    return result


@njit(cache=True, inline="always")
def dot(a, b):
    """Dot product of the first three elements of arrays (3,) or (4,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
