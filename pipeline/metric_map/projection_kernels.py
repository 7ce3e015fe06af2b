"""The projective update: which voxels do the rays of a depth image end in, and which do they cross?

Everything is measured in the scan's box: ``camera`` is the optical centre and ``rotation`` turns camera axes into map
axes, in metres from the box's corner. Voxel (i, j, k) of the box spans [i, i + 1] · size and so on.
"""

import numpy as np
from numba import njit

FREE, HIT = 1, 2
TILE = 8
"""Pixels along a side of the finest pyramid level's tiles."""
SAMPLES = 8
"""Pixels looked at along each side of a voxel's footprint in the image."""
BLOCK = 8
"""Voxels along a side of the blocks that are tried as a whole first."""


@njit(cache=True)
def _voxels_of_row(row, far, base, step, origin, ny, nz, nowhere, index):
    """Fill ``index`` with the flat voxel that each return of an image row falls in."""
    zero = np.float32(0)
    o0, o1, o2 = origin[0], origin[1], origin[2]
    a0, a1, a2 = base[0], base[1], base[2]
    b0, b1, b2 = step[0], step[1], step[2]
    for u in range(row.size):
        column = np.float32(np.int32(u))
        ends = (row[u] > zero) & (row[u] <= far)
        d = row[u] if ends else zero
        i = np.int32(o0 + d * (a0 + b0 * column))
        j = np.int32(o1 + d * (a1 + b1 * column))
        k = np.int32(o2 + d * (a2 + b2 * column))
        # numba widens int32 products; narrowing each step keeps the loop in 32-bit vectors.
        index[u] = np.int32(np.int32(np.int32(i * ny) + j) * nz) + k if ends else nowhere


@njit(cache=True)
def _extremes_of_row(row, far, least, greatest):
    """Fold how far the rays of an image row reach into the least and the greatest of each column."""
    zero, infinity = np.float32(0), np.float32(np.inf)
    for u in range(row.size):
        d = row[u] if (row[u] > zero) & (row[u] < infinity) else zero
        reach = d if d < far else far
        least[u] = reach if reach < least[u] else least[u]
        greatest[u] = reach if reach > greatest[u] else greatest[u]


@njit(cache=True)
def _extremes_of_tiles(least, greatest, low, high):
    """Fold the columns' extremes into those of the tiles of one row of tiles."""
    for t in range(low.size):
        smallest, largest = least[t * TILE], greatest[t * TILE]
        for u in range(t * TILE + 1, min((t + 1) * TILE, least.size)):
            smallest = min(smallest, least[u])
            largest = max(largest, greatest[u])
        low[t], high[t] = smallest, largest


@njit(cache=True)
def mark_returns(depth, far, focal, centre, camera, rotation, size, shape, marks, low, high):
    """Mark the voxel that each return falls in as HIT and fill the finest pyramid level.

    Args:
        depth: (H, W) float32, m; what is not a positive finite number is no return.
        far: returns at most this deep are end points; deeper ones reach this far and end nowhere.
        focal, centre: (2,) float64, pixels.
        camera, rotation, size: see above.
        shape: (3,) voxels of the box.
        marks: flat uint8, one more than the box has voxels.
        low, high: (H / TILE, W / TILE) float32 to fill: the least and the greatest reach in a tile (0 = no return).
    """
    height, width = depth.shape
    far = np.float32(far)
    nowhere = np.int32(marks.size - 1)
    ny, nz = np.int32(shape[1]), np.int32(shape[2])
    origin = (camera / size).astype(np.float32)
    step = (rotation[:, 0] / (focal[0] * size)).astype(np.float32)
    index = np.empty(width, np.int32)
    least, greatest = np.empty(width, np.float32), np.empty(width, np.float32)
    x = (0.5 - centre[0]) / focal[0]
    for top in range(0, height, TILE):
        least[:] = np.inf
        greatest[:] = 0
        for v in range(top, min(top + TILE, height)):
            y = (v + 0.5 - centre[1]) / focal[1]
            base = ((rotation[:, 0] * x + rotation[:, 1] * y + rotation[:, 2]) / size).astype(np.float32)
            _voxels_of_row(depth[v], far, base, step, origin, ny, nz, nowhere, index)
            for u in range(width):
                marks[np.uint32(index[u])] = HIT
            _extremes_of_row(depth[v], far, least, greatest)
        _extremes_of_tiles(least, greatest, low[top // TILE], high[top // TILE])
    marks[nowhere] = 0


@njit(cache=True)
def build_pyramid(low, high):
    """Fill the coarser levels: a tile of level n + 1 covers 2 × 2 of level n.

    Args:
        low, high: (levels, H / TILE, W / TILE) float32, level 0 filled; level n uses its first ⌈shape / 2ⁿ⌉ tiles.
    """
    levels, height, width = low.shape
    for level in range(1, levels):
        rows, columns = (height + 1) // 2, (width + 1) // 2
        for i in range(rows):
            for j in range(columns):
                bottom, right = min(2 * i + 1, height - 1), min(2 * j + 1, width - 1)
                a, b = low[level - 1], high[level - 1]
                low[level, i, j] = min(a[2 * i, 2 * j], a[bottom, 2 * j], a[2 * i, right], a[bottom, right])
                high[level, i, j] = max(b[2 * i, 2 * j], b[bottom, 2 * j], b[2 * i, right], b[bottom, right])
        height, width = rows, columns


@njit(cache=True)
def _extremes(low, high, u0, u1, v0, v1):
    """Bounds of the reach over the pixels u0..u1 × v0..v1, from at most 3 × 3 tiles."""
    level, shift = 0, 3
    while (u1 >> shift) - (u0 >> shift) > 2 or (v1 >> shift) - (v0 >> shift) > 2:
        level, shift = level + 1, shift + 1
    smallest, largest = np.float32(np.inf), np.float32(0)
    for i in range(v0 >> shift, (v1 >> shift) + 1):
        for j in range(u0 >> shift, (u1 >> shift) + 1):
            smallest = min(smallest, low[level, i, j])
            largest = max(largest, high[level, i, j])
    return smallest, largest


@njit(cache=True)
def _interval(x, h, near, far, focal, centre):
    """First and last pixel, along one image axis, whose ray can meet a cuboid with x ± h and depth near..far."""
    a, b = x - h, x + h
    first = a / near if a < 0 else a / far
    last = b / near if b > 0 else b / far
    return int(np.ceil(first * focal + centre - 0.5)), int(np.floor(last * focal + centre - 0.5))


@njit(cache=True)
def _entry(dx, dy, dz, x, y, z, half):
    """Ray parameter at which the ray along d enters the cube (x, y, z) ± half; infinite if it misses."""
    enter, leave = 0.0, np.inf
    for d, c in ((dx, x), (dy, y), (dz, z)):
        if d == 0.0:
            if abs(c) >= half:
                return np.inf
        else:
            a, b = (c - half) / d, (c + half) / d
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    return enter if enter < leave else np.inf


@njit(cache=True)
def _reach(d, far, margin):
    """How deep the ray of a pixel with depth d frees space; see MetricMapConfig.margin."""
    if not (d > 0 and d < np.inf):
        return -1.0
    d = min(d, far)
    return d - margin[0] - margin[1] * d * d


@njit(cache=True)
def _is_crossed(depth, far, margin, focal, centre, rotation, u0, u1, v0, v1, nearest, x, y, z, half):
    """Does the ray of a sampled pixel enter the cube (x, y, z) ± half, map axes, before it ends?"""
    columns, rows = min(SAMPLES, u1 - u0 + 1), min(SAMPLES, v1 - v0 + 1)
    for i in range(rows):
        v = v0 + (2 * i + 1) * (v1 - v0 + 1) // (2 * rows)
        b = (v + 0.5 - centre[1]) / focal[1]
        for j in range(columns):
            u = u0 + (2 * j + 1) * (u1 - u0 + 1) // (2 * columns)
            reach = _reach(depth[v, u], far, margin)
            if reach > nearest:
                a = (u + 0.5 - centre[0]) / focal[0]
                dx = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2]
                dy = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2]
                dz = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2]
                if _entry(dx, dy, dz, x, y, z, half) < reach:
                    return True
    return False


@njit(cache=True)
def mark_free(depth, far, margin, focal, centre, camera, rotation, size, marks, low, high):
    """Mark as FREE every voxel that is not a HIT and that a ray crosses before it ends.

    Args:
        marks: (nx, ny, nz) uint8.
        margin: (2,) float64, see MetricMapConfig.
        low, high: the pyramid of ``build_pyramid``.
        depth, far, focal, centre, camera, rotation, size: as in ``mark_returns``.
    """
    nx, ny, nz = marks.shape
    spread = np.abs(rotation).sum(axis=0) * (0.5 * size)
    for i in range(0, nx, BLOCK):
        for j in range(0, ny, BLOCK):
            for k in range(0, nz, BLOCK):
                ends = (min(i + BLOCK, nx), min(j + BLOCK, ny), min(k + BLOCK, nz))
                _mark_free_block(
                    depth,
                    far,
                    margin,
                    focal,
                    centre,
                    camera,
                    rotation,
                    size,
                    spread,
                    marks,
                    low,
                    high,
                    i,
                    j,
                    k,
                    ends,
                )


@njit(cache=True)
def _mark_free_block(
    depth, far, margin, focal, centre, camera, rotation, size, spread, marks, low, high, i0, j0, k0, ends
):
    """Decide a block of voxels at once if that is possible, and voxel by voxel if it is not."""
    height, width = depth.shape
    half = 0.5 * size
    x = (i0 + 0.5 * BLOCK) * size - camera[0]
    y = (j0 + 0.5 * BLOCK) * size - camera[1]
    z = (k0 + 0.5 * BLOCK) * size - camera[2]
    w = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    near, deep = w - BLOCK * spread[2], w + BLOCK * spread[2]
    if deep <= 0 or near >= far:
        return
    fills = False
    if near > size:
        r = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
        d = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
        u0, u1 = _interval(r, BLOCK * spread[0], near, deep, focal[0], centre[0])
        v0, v1 = _interval(d, BLOCK * spread[1], near, deep, focal[1], centre[1])
        if u0 >= width or v0 >= height or u1 < 0 or v1 < 0:
            return
        inside = u0 >= 0 and v0 >= 0 and u1 < width and v1 < height
        least, greatest = _extremes(
            low, high, max(u0, 0), min(u1, width - 1), max(v0, 0), min(v1, height - 1)
        )
        if _reach(greatest, far, margin) <= near:
            return
        # A cube's outline holds a circle of its side: where that is wider than a pixel's diagonal, some ray hits it.
        dense = min(focal[0], focal[1]) * size > 1.5 * deep
        fills = inside and dense and _reach(least, far, margin) > deep
    for i in range(i0, ends[0]):
        for j in range(j0, ends[1]):
            for k in range(k0, ends[2]):
                if marks[i, j, k] != 0:
                    continue
                if fills:
                    marks[i, j, k] = FREE
                    continue
                x, y, z = (
                    (i + 0.5) * size - camera[0],
                    (j + 0.5) * size - camera[1],
                    (k + 0.5) * size - camera[2],
                )
                w = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
                near, deep = w - spread[2], w + spread[2]
                if deep <= 0 or near >= far:
                    continue
                u0, u1, v0, v1 = 0, width - 1, 0, height - 1
                if near > 0.1 * size:
                    r = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
                    d = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
                    u, v = (
                        int(np.floor(r / w * focal[0] + centre[0])),
                        int(np.floor(d / w * focal[1] + centre[1])),
                    )
                    if u >= 0 and v >= 0 and u < width and v < height:
                        dense = min(focal[0], focal[1]) * size > 1.5 * w
                        if dense and _reach(depth[v, u], far, margin) > w:
                            marks[i, j, k] = FREE
                            continue
                    u0, u1 = _interval(r, spread[0], near, deep, focal[0], centre[0])
                    v0, v1 = _interval(d, spread[1], near, deep, focal[1], centre[1])
                    if u0 >= width or v0 >= height or u1 < 0 or v1 < 0 or u0 > u1 or v0 > v1:
                        continue
                    u0, u1, v0, v1 = max(u0, 0), min(u1, width - 1), max(v0, 0), min(v1, height - 1)
                    _, greatest = _extremes(low, high, u0, u1, v0, v1)
                    if _reach(greatest, far, margin) <= near:
                        continue
                if _is_crossed(
                    depth, far, margin, focal, centre, rotation, u0, u1, v0, v1, near, x, y, z, half
                ):
                    marks[i, j, k] = FREE
