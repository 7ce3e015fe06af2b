"""Loops over surfels and their neighbours: normals and region growing."""

import numpy as np
from numba import njit

from pipeline.segments.surfels_kernels import NONE


@njit(cache=True)
def normals(points, near):
    """(N, 3) float64 unit normals of the points' neighbourhoods, and the neighbourhoods' (N,) float64 variation.

    Variation is the smallest eigenvalue of the covariance divided by the sum of all three eigenvalues: 0 for a plane,
    1/3 for a ball (Pauly, Gross & Kobbelt 2002). A point with fewer than three neighbours has a variation of 1 and a
    normal of zeros.
    """
    result, variation = np.zeros((len(points), 3)), np.ones(len(points))
    for i in range(len(points)):
        # Offsets are relative to the point itself, whose own contribution to the sums is therefore zero.
        n, m, s = 1, np.zeros(3), np.zeros((3, 3))
        for j in near[i]:
            if j == NONE:
                break
            x = points[j].astype(np.float64) - points[i]
            for a in range(3):
                m[a] += x[a]
                for b in range(3):
                    s[a, b] += x[a] * x[b]
            n += 1
        if n < 4:
            continue
        for a in range(3):
            for b in range(3):
                s[a, b] = s[a, b] / n - m[a] * m[b] / (n * n)
        trace = s[0, 0] + s[1, 1] + s[2, 2]
        least = smallest_eigenvalue(s)
        for a in range(3):
            s[a, a] -= least
        result[i] = null_vector(s)
        variation[i] = max(least, 0.0) / trace if trace > 0 else 1.0
    return result, variation


@njit(cache=True)
def smallest_eigenvalue(s):
    """The smallest eigenvalue of a symmetric 3×3 matrix, in closed form (Smith 1961)."""
    mean = (s[0, 0] + s[1, 1] + s[2, 2]) / 3
    a, b, c = s[0, 0] - mean, s[1, 1] - mean, s[2, 2] - mean
    xy, xz, yz = s[0, 1], s[0, 2], s[1, 2]
    p = np.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if p == 0:
        return mean
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    half = min(max(determinant / (2 * p * p * p), -1.0), 1.0)
    return mean + 2 * p * np.cos(np.arccos(half) / 3 + 2 * np.pi / 3)


@njit(cache=True)
def null_vector(s):
    """The unit null vector of a symmetric 3×3 matrix of rank 2: the direction of its rows' longest cross product."""
    best, longest = np.zeros(3), 0.0
    for r, q in ((0, 1), (0, 2), (1, 2)):
        x = s[r, 1] * s[q, 2] - s[r, 2] * s[q, 1]
        y = s[r, 2] * s[q, 0] - s[r, 0] * s[q, 2]
        z = s[r, 0] * s[q, 1] - s[r, 1] * s[q, 0]
        length = np.sqrt(x * x + y * y + z * z)
        if length > longest:
            longest = length
            best[0], best[1], best[2] = x / length, y / length, z / length
    return best


@njit(cache=True)
def grow_regions(points, near, normal, order, min_cosine, max_offset):
    """(N,) int32 region of every point, or NONE; regions are connected and have nearly constant normals.

    Seeds are taken in ``order``. A neighbour of a point in the region joins the region under two conditions:

    - The cosine of the angle between the neighbour's normal and the region's mean normal is at least ``min_cosine``,
      so that a region does not creep around an edge.
    - The neighbour's distance from the plane through the point, perpendicular to the mean normal, is at most
      ``max_offset`` m, so that a region does not extend over a step.

    Points without a normal get NONE.
    """
    region = np.full(len(points), NONE, np.int32)
    queue = np.empty(len(points), np.int32)
    count = 0
    for seed in order:
        if region[seed] != NONE or not normal[seed].any():
            continue
        queue[0], head, tail = seed, 0, 1
        region[seed] = count
        total = normal[seed].copy()
        while head < tail:
            i = queue[head]
            head += 1
            for j in near[i]:
                if j == NONE:
                    break
                if region[j] != NONE:
                    continue
                length = np.sqrt((total * total).sum())
                # The sign of a neighbourhood's normal is arbitrary.
                dot = (total * normal[j]).sum()
                offset = (total * (points[j] - points[i])).sum()
                if abs(dot) >= min_cosine * length and abs(offset) <= max_offset * length:
                    total += normal[j] if dot > 0 else -normal[j]
                    region[j] = count
                    queue[tail] = j
                    tail += 1
        count += 1
    return region


@njit(cache=True)
def nearest_regions(points, near, members, region, planes, max_distance):
    """(M,) int32, for each of ``members``, the region with the nearest plane among the member's and its neighbours'.

    ``planes`` has (R, 4) rows [n, d]. A point gets NONE if its distance from each of these regions' planes is at
    least ``max_distance`` m.
    """
    result = np.full(len(members), NONE, np.int32)
    for m in range(len(members)):
        i = members[m]
        least, result[m] = nearer_region(points[i], region[i], planes, max_distance, NONE)
        for j in near[i]:
            if j == NONE:
                break
            least, result[m] = nearer_region(points[i], region[j], planes, least, result[m])
    return result


@njit(cache=True)
def nearer_region(point, region, planes, least, so_far):
    """Distance of a point (3,) from a region's plane, m, and the region, if this distance is below ``least``, m.

    Otherwise ``least``, the distance from the nearest region's plane so far, and ``so_far``, that region.
    """
    if region == NONE:
        return least, so_far
    plane = planes[region]
    distance = abs(point[0] * plane[0] + point[1] * plane[1] + point[2] * plane[2] - plane[3])
    return (distance, region) if distance < least else (least, so_far)
