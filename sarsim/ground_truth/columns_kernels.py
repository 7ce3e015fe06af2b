"""Compiled loops over the columns of bodies above the cells of a grid."""

import numpy as np
from numba import njit

_UPRIGHT = 1e-4
"""A face is vertical if |z| of its unit normal is smaller than this; not 0, because mesh vertices are float32."""


@njit(cache=True)
def vertical_cut(planes, x, y):
    """Lowest and highest z, m, of a vertical line inside a convex body n·p ≤ d, and z of the normal at the highest.

    If the line misses the body, the lowest is above the highest. ``planes``: (F, 4) n and d.
    """
    low, high, normal_z = -np.inf, np.inf, 1.0
    for k in range(planes.shape[0]):
        nz = planes[k, 2]
        rest = planes[k, 3] - planes[k, 0] * x - planes[k, 1] * y
        if abs(nz) < _UPRIGHT:
            if rest < 0:
                return 1.0, 0.0, 1.0
        elif nz > 0:
            if rest / nz < high:
                high, normal_z = rest / nz, nz
        else:
            low = max(low, rest / nz)
    return low, high, normal_z


@njit(cache=True)
def count_bodies(planes, first, window, origin, cell, count):
    """Add the number of convex bodies on the vertical through each cell's centre to ``count`` (nx, ny).

    Body n has the rows ``first[n]:first[n + 1]`` of the (M, 4) planes, and lies within the cells window[n] = (i0, i1,
    j0, j1).
    """
    for n in range(len(window)):
        for i in range(window[n, 0], window[n, 1]):
            for j in range(window[n, 2], window[n, 3]):
                x, y = origin[0] + (i + 0.5) * cell, origin[1] + (j + 0.5) * cell
                low, high, _ = vertical_cut(planes[first[n] : first[n + 1]], x, y)
                count[i, j] += low < high


@njit(cache=True)
def fill_bodies(planes, first, window, origin, cell, start, bottom, top, normal_z, owner):
    """Write the bodies over each cell from index ``start`` (nx, ny) on, and advance ``start`` by their number."""
    for n in range(len(window)):
        for i in range(window[n, 0], window[n, 1]):
            for j in range(window[n, 2], window[n, 3]):
                x, y = origin[0] + (i + 0.5) * cell, origin[1] + (j + 0.5) * cell
                low, high, nz = vertical_cut(planes[first[n] : first[n + 1]], x, y)
                if low < high:
                    k = start[i, j]
                    bottom[k], top[k], normal_z[k], owner[k] = low, high, nz, n
                    start[i, j] += 1


@njit(cache=True)
def merge_bodies(start, count, bottom, top, normal_z, owner, gap):
    """Sort the bodies (B,) of every cell from bottom to top and merge those less than ``gap`` m apart, in place.

    A merged body takes the highest top, with its normal and owner. ``count`` becomes the number of merged bodies.
    """
    for i in range(count.shape[0]):
        for j in range(count.shape[1]):
            a, n = start[i, j], count[i, j]
            for k in range(a + 1, a + n):
                b, t, z, o = bottom[k], top[k], normal_z[k], owner[k]
                m = k
                while m > a and bottom[m - 1] > b:
                    bottom[m], top[m] = bottom[m - 1], top[m - 1]
                    normal_z[m], owner[m] = normal_z[m - 1], owner[m - 1]
                    m -= 1
                bottom[m], top[m], normal_z[m], owner[m] = b, t, z, o
            last = a
            for k in range(a + 1, a + n):
                if bottom[k] < top[last] + gap:
                    if top[k] > top[last]:
                        top[last], normal_z[last], owner[last] = top[k], normal_z[k], owner[k]
                else:
                    last += 1
                    bottom[last], top[last] = bottom[k], top[k]
                    normal_z[last], owner[last] = normal_z[k], owner[k]
            if n:
                count[i, j] = last - a + 1


@njit(cache=True)
def nearest_top(start, count, bottom, top, i, j, height, reach, headroom):
    """Index in (B,) of the top with headroom that is nearest to ``height``, within ``reach``; -1 if there is none."""
    best, best_distance = -1, reach
    a, n = start[i, j], count[i, j]
    for k in range(a, a + n):
        free = k == a + n - 1 or bottom[k + 1] - top[k] >= headroom
        if free and abs(top[k] - height) <= best_distance:
            best, best_distance = k, abs(top[k] - height)
    return best


@njit(cache=True)
def _is_blocked(start, count, bottom, top, owner, is_obstacle, i, j, low, high):
    """Whether the lowest body between two heights is an obstacle."""
    for k in range(start[i, j], start[i, j] + count[i, j]):
        if bottom[k] < high and top[k] > low:
            return is_obstacle[owner[k]]
    return False


@njit(cache=True)
def flood(
    start, count, bottom, top, normal_z, owner, is_obstacle, first_i, first_j, first_body, max_step, headroom,
    min_normal_z, height, edge
):  # fmt: skip
    """Flood-fill the ground from a first cell over steps of at most ``max_step``.

    Fills ``height`` (nx, ny), NaN where the ground does not reach, and ``edge`` (nx, ny). Cells are edges if the
    ground ends there at a step, a drop, too little headroom or the grid's border, or if they are too steep to
    continue. Obstacles cause no edge.
    """
    nx, ny = height.shape
    queue = np.empty((nx * ny, 2), np.int32)
    queue[0, 0], queue[0, 1] = first_i, first_j
    height[first_i, first_j] = top[first_body]
    head, tail = 0, 1
    while head < tail:
        i, j = queue[head, 0], queue[head, 1]
        head += 1
        here = height[i, j]
        for a in range(i - 1, i + 2):
            for b in range(j - 1, j + 2):
                if not (0 <= a < nx and 0 <= b < ny):
                    edge[i, j] = True
                elif np.isnan(height[a, b]):
                    k = nearest_top(start, count, bottom, top, a, b, here, max_step, headroom)
                    if k < 0:
                        low, high = here + max_step, here + headroom
                        if not _is_blocked(start, count, bottom, top, owner, is_obstacle, a, b, low, high):
                            edge[i, j] = True
                        continue
                    height[a, b] = top[k]
                    if normal_z[k] < min_normal_z:
                        edge[a, b] = True
                    else:
                        queue[tail, 0], queue[tail, 1] = a, b
                        tail += 1
                elif abs(height[a, b] - here) > max_step:
                    edge[i, j] = True
                    edge[a, b] = True


@njit(cache=True)
def write_lowest_tops(start, count, bottom, top, owner, chosen, headroom, height):
    """In each cell, write the lowest top of a chosen body with headroom above it, if there is one, to ``height``."""
    for i in range(count.shape[0]):
        for j in range(count.shape[1]):
            end = start[i, j] + count[i, j]
            for k in range(start[i, j], end):
                if chosen[owner[k]] and (k == end - 1 or bottom[k + 1] - top[k] >= headroom):
                    height[i, j] = top[k]
                    break


@njit(cache=True)
def write_owners(start, count, top, owner, height, result):
    """Write the owner of the ground at ``height`` (nx, ny) to ``result``; cells without ground stay unchanged."""
    for i in range(count.shape[0]):
        for j in range(count.shape[1]):
            for k in range(start[i, j], start[i, j] + count[i, j]):
                if top[k] == height[i, j]:
                    result[i, j] = owner[k]


@njit(cache=True)
def lower_distance(corners, first, window, low, high, origin, cell, height, max_step, headroom, distance):
    """Lower ``distance`` (nx, ny), m, to each cell's distance from the nearest outline that obstructs its ground.

    Convex outline n has the corners ``first[n]:first[n + 1]`` of (M, 2), counter-clockwise, and extends in z from
    low[n] to high[n]. A body does not obstruct the ground if it ends below the height of a step or begins above the
    headroom.
    """
    for n in range(len(window)):
        for i in range(window[n, 0], window[n, 1]):
            for j in range(window[n, 2], window[n, 3]):
                ground = height[i, j]
                # Where the ground is NaN, every body obstructs it, because the body itself may cover the cell.
                if high[n] <= ground + max_step or low[n] >= ground + headroom:
                    continue
                x, y = origin[0] + (i + 0.5) * cell, origin[1] + (j + 0.5) * cell
                d = _distance_to_outline(corners[first[n] : first[n + 1]], x, y)
                distance[i, j] = min(distance[i, j], d)


@njit(cache=True)
def _distance_to_outline(corners, x, y):
    """Distance in m from a point to a convex polygon, 0 inside."""
    inside, nearest = True, np.inf
    m = len(corners)
    for k in range(m):
        ax, ay = corners[k]
        bx, by = corners[(k + 1) % m]
        dx, dy = bx - ax, by - ay
        if dx * (y - ay) - dy * (x - ax) < 0:
            inside = False
        length2 = dx * dx + dy * dy
        t = ((x - ax) * dx + (y - ay) * dy) / length2 if length2 > 0 else 0.0
        t = min(max(t, 0.0), 1.0)
        nearest = min(nearest, np.hypot(x - ax - t * dx, y - ay - t * dy))
    return 0.0 if inside and m > 2 else nearest
