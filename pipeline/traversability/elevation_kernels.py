"""Compiled loops of the elevation map and of the traversability."""

import numpy as np
from numba import njit

NOISE = 0.1
"""Share of a bin's hits that may stray into the next one."""


@njit(cache=True)
def accumulate(points, origin, cell, z_min, z_bin, height, hits, returns):
    """Fold points into the mean height of their bin of their column; ``returns`` (nx, ny) counts them."""
    nx, ny, nz = height.shape
    for n in range(points.shape[0]):
        i = int(np.floor((points[n, 0] - origin[0]) / cell))
        j = int(np.floor((points[n, 1] - origin[1]) / cell))
        k = int(np.floor((points[n, 2] - z_min) / z_bin))
        if not (0 <= i < nx and 0 <= j < ny and 0 <= k < nz):
            continue
        # The count saturates, so that an old surface can still follow a slow change.
        if hits[i, j, k] < 1000:
            hits[i, j, k] += 1
        height[i, j, k] += (points[n, 2] - height[i, j, k]) / hits[i, j, k]
        returns[i, j] += 1


@njit(cache=True)
def column_height(height, hits, min_hits, headroom, z_bin):
    """Height of the lowest surface of one column with ``headroom`` above it; NaN where nothing was measured.

    Adjacent filled bins are one body, and so are bodies with too little air between them. A body thinner than
    a bin is a sloping or noisy floor whose mean counts; of a thicker one, an obstacle, the top counts. A bin with few
    hits beside one with many is that one's noise.
    """
    bottom, top = np.nan, np.nan
    total, weight = 0.0, 0.0
    for k in range(height.shape[0]):
        beside = max(hits[k - 1] if k > 0 else 0, hits[k + 1] if k + 1 < len(hits) else 0)
        if hits[k] < min_hits or hits[k] < NOISE * beside:
            continue
        if not np.isnan(top) and height[k] - top >= headroom:
            break
        if np.isnan(bottom):
            bottom = height[k]
        top = height[k]
        total += hits[k] * height[k]
        weight += hits[k]
    if top - bottom < 0.5 * z_bin:
        return total / weight
    return top


@njit(cache=True)
def count_points(points, origin, cell, elevation, max_distance, count):
    """``count`` (nx, ny) the points in each cell that lie no further than this above or below it, m.

    Where the elevation is unknown all count.
    """
    nx, ny = elevation.shape
    for n in range(points.shape[0]):
        i = int(np.floor((points[n, 0] - origin[0]) / cell))
        j = int(np.floor((points[n, 1] - origin[1]) / cell))
        if 0 <= i < nx and 0 <= j < ny and not abs(points[n, 2] - elevation[i, j]) > max_distance:
            count[i, j] += 1


@njit(cache=True)
def renew_dropout(direction, dropouts, returns, min_points, camera, origin, cell, cos_other_side):
    """Mark the cells with ``min_points`` dropouts, and clear those that another keyframe has shown whole.

    ``direction`` (nx, ny, 2) is the level direction from which a cell's last dropout was seen, 0 where there is none.
    A keyframe clears a cell if it has ``min_points`` returns and no dropout there, from a direction whose cosine to
    that one is less than ``cos_other_side``. ``dropouts`` and ``returns`` (nx, ny) count the points of the keyframe
    from ``camera`` (2,).
    """
    nx, ny = dropouts.shape
    for i in range(nx):
        for j in range(ny):
            if dropouts[i, j] < min_points and returns[i, j] < min_points:
                continue
            dx, dy = origin[0] + (i + 0.5) * cell - camera[0], origin[1] + (j + 0.5) * cell - camera[1]
            distance = np.sqrt(dx * dx + dy * dy) + 1e-9
            dx, dy = dx / distance, dy / distance
            if dropouts[i, j] >= min_points:
                direction[i, j, 0], direction[i, j, 1] = dx, dy
            elif dropouts[i, j] == 0 and abs(dx * direction[i, j, 0] + dy * direction[i, j, 1]) < cos_other_side:
                direction[i, j, 0], direction[i, j, 1] = 0.0, 0.0


@njit(cache=True)
def extract_elevation(height, hits, returns, min_hits, headroom, z_bin, elevation):
    """Renew ``elevation`` (nx, ny) of the columns with ``returns`` (nx, ny)."""
    nx, ny = elevation.shape
    for i in range(nx):
        for j in range(ny):
            if returns[i, j] > 0:
                elevation[i, j] = column_height(height[i, j], hits[i, j], min_hits, headroom, z_bin)


@njit(cache=True)
def bridge_gaps(elevation, dropout, max_gap, max_spread):
    """Fill what is unknown between two known cells of nearly one height, at most ``max_gap`` unknown cells apart.

    Along the axes and the diagonals; where several pairs face each other, the last one counts. Nothing is filled
    across a ``dropout`` (nx, ny) cell.
    """
    filled = elevation.copy()
    nx, ny = elevation.shape
    for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
        for i in range(nx):
            for j in range(ny):
                if np.isnan(elevation[i, j]):
                    continue
                for gap in range(1, max_gap + 2):
                    a, b = i + gap * di, j + gap * dj
                    if not (a < nx and 0 <= b < ny) or dropout[a, b]:
                        break
                    rise = elevation[a, b] - elevation[i, j]
                    if np.isnan(rise):
                        continue
                    for k in range(1, gap):
                        if abs(rise) <= max_spread and np.isnan(elevation[i + k * di, j + k * dj]):
                            filled[i + k * di, j + k * dj] = elevation[i, j] + rise * k / gap
                    break
    return filled


@njit(cache=True)
def step_hazards(elevation, max_step):
    """The higher cell of every two neighbours, of eight, that differ by more than ``max_step`` m."""
    nx, ny = elevation.shape
    hazard = np.zeros((nx, ny), np.bool_)
    for i in range(nx):
        for j in range(ny):
            for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
                a, b = i + di, j + dj
                if not (a < nx and 0 <= b < ny):
                    continue
                rise = elevation[a, b] - elevation[i, j]
                hazard[a, b] |= rise > max_step
                hazard[i, j] |= rise < -max_step
    return hazard


@njit(cache=True)
def drops(elevation, max_gap, max_step, steepest):
    """The higher of two known cells on both sides of unknown ground that cannot join them as a slope.

    Along the axes and the diagonals, at most ``max_gap`` unknown cells apart. ``steepest`` is the greatest rise in m
    from one cell to the next of a slope that the robot takes.
    """
    nx, ny = elevation.shape
    drop = np.zeros((nx, ny), np.bool_)
    for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
        stretch = np.sqrt(di * di + dj * dj)
        for i in range(nx):
            for j in range(ny):
                if np.isnan(elevation[i, j]):
                    continue
                for gap in range(1, max_gap + 2):
                    a, b = i + gap * di, j + gap * dj
                    if not (a < nx and 0 <= b < ny):
                        break
                    rise = elevation[a, b] - elevation[i, j]
                    if np.isnan(rise):
                        continue
                    if gap > 1 and abs(rise) > max_step + steepest * gap * stretch:
                        if rise > 0:
                            drop[a, b] = True
                        else:
                            drop[i, j] = True
                    break
    return drop


@njit(cache=True)
def gradients(elevation, cell, radius):
    """(nx, ny, 2) slope of the least-squares plane through each cell's round neighbourhood; 0 where unknown.

    Neighbours beyond a slope of 50° belong to another surface (a wall, the floor under a deck) and stay out.
    """
    nx, ny = elevation.shape
    result = np.zeros((nx, ny, 2), np.float32)
    for i in range(nx):
        for j in range(ny):
            h0 = elevation[i, j]
            if np.isnan(h0):
                continue
            n = sx = sy = sz = sxx = sxy = syy = sxz = syz = 0.0
            for di in range(-radius, radius + 1):
                for dj in range(-radius, radius + 1):
                    a, b = i + di, j + dj
                    if di * di + dj * dj > radius * radius or not (0 <= a < nx and 0 <= b < ny):
                        continue
                    dz = elevation[a, b] - h0
                    x, y = di * cell, dj * cell
                    if np.isnan(dz) or abs(dz) > 1.2 * np.sqrt(x * x + y * y) + 0.02:
                        continue
                    n, sx, sy, sz = n + 1, sx + x, sy + y, sz + dz
                    sxx, sxy, syy, sxz, syz = (sxx + x * x, sxy + x * y, syy + y * y, sxz + x * dz, syz + y * dz)
            if n < 4:
                continue
            sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
            sxz, syz = sxz - sx * sz / n, syz - sy * sz / n
            determinant = sxx * syy - sxy * sxy
            if determinant > 1e-9:
                result[i, j, 0] = (sxz * syy - syz * sxy) / determinant
                result[i, j, 1] = (syz * sxx - sxz * sxy) / determinant
    return result
