"""The projective update: finds the voxels in which the rays of a depth image end, and the voxels that they cross.

The marks of a scan form a box of whole blocks of voxels. Points in the box are in voxels, relative to its corner.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.geometry.ray_kernels import FREE, HIT, mark_line
from pipeline.metric_map.grid_kernels import WORD

# fastmath={"contract"} fuses a product and a sum into one instruction, which rounds once instead of twice.

BLOCK = WORD
"""Side of the blocks of voxels that are tested together, voxels."""
CORNERS_PER_SIDE = BLOCK + 1
"""Number of voxel corners along a side of a block."""
CORNER_COUNT = -(-(CORNERS_PER_SIDE**3) // 64) * 64
"""Number of corners in a block, padded with copies of the last one to a multiple of 64, which fills whole vectors."""
SEEN, HIDDEN = np.uint8(1), np.uint8(2)
"""Flags of corners and voxels, see :func:`_flag_corners` and :func:`_join_corners`."""
TILE = 8
"""Side of the tiles of the depth pyramid's finest level, pixels."""

MIN_DEPTH = np.finfo(np.float32).eps
"""Depth below which nothing is visible, m."""


class DepthCamera(NamedTuple):
    """The geometry of a depth image."""

    fx: float
    fy: float
    cx: float
    cy: float
    max_depth: float
    """Depth up to which returns are end points, m; the rays of deeper returns free space up to this depth."""
    margin: float
    """Difference in depth, m, between the end of a ray and the point up to which the ray frees space."""
    origin: NDArray[np.float64]
    """(3,) position of the optical centre in the box, voxels."""
    axes: NDArray[np.float64]
    """(3, 3) the camera's x, y and z axes (rows) in the map, voxels per metre."""
    size: float
    """Side of a voxel, m."""
    narrow_depth: float
    """Depth up to which the field of view can pass between the corners of voxels, voxels."""


@njit(cache=True, nogil=True)
def mark_depth_image(depth, pinhole, pose, size, max_depth, margin, narrow_depth, marks, flat, high):
    """Mark the voxels in which rays end as HIT, and the voxels that rays only cross as FREE.

    Args:
        depth: (H, W) float32, m; a value that is not positive and finite means no return.
        pinhole: (4,) float64 fx, fy, cx, cy in pixels.
        pose: (3, 4) float64: rotation from camera axes to map axes, and the optical centre in the box, voxels.
        size, max_depth, margin, narrow_depth: see :class:`DepthCamera`.
        marks: (nx, ny, nz) uint8 zeros, whole blocks that contain the view frustum.
        flat: the same marks in C order, and a last element that takes the marks of pixels without an end point.
        high: (levels, ⌈H / TILE⌉, ⌈W / TILE⌉) float32, the depth pyramid, which is filled.
    """
    axes = np.ascontiguousarray(pose[:, :3].T) / size
    origin = pose[:, 3].copy()
    fx, fy, cx, cy = pinhole
    camera = DepthCamera(fx, fy, cx, cy, max_depth, margin, origin, axes, size, narrow_depth)
    _mark_returns(depth, camera, marks.shape, flat, high[0])
    _build_pyramid(high)
    _mark_narrow(depth, camera, marks)
    _mark_free(depth, camera, marks, high)


@njit(cache=True)
def _mark_returns(depth, camera, shape, flat, high):
    """Mark the voxel of each return as HIT, and fill ``high`` with the greatest depth of each tile (0: no return)."""
    height, width = depth.shape
    nowhere = np.int32(flat.size - 1)
    max_depth = np.float32(camera.max_depth)
    ny, nz = np.int32(shape[1]), np.int32(shape[2])
    origin, step = camera.origin.astype(np.float32), (camera.axes[0] / camera.fx).astype(np.float32)
    first = _first_of_rows(height, camera)
    index = np.empty(width, np.int32)
    deepest = np.zeros(high.shape[1] * TILE, np.float32)
    for top in range(0, height, TILE):
        for v in range(top, min(top + TILE, height)):
            _voxels_of_row(depth[v], max_depth, first[v], step, origin, ny, nz, nowhere, index)
            for u in range(width):
                flat[np.uint32(index[u])] = HIT
        _deepest_of_columns(depth, top, deepest)
        _deepest_of_tiles(deepest, max_depth, high[top // TILE])
    flat[nowhere] = 0


@njit(cache=True)
def _first_of_rows(height, camera):
    """(H, 3) float32 vectors from the camera to the point at 1 m depth in the first pixel of each row, voxels."""
    first = np.empty((height, 3), np.float32)
    x = (0.5 - camera.cx) / camera.fx
    for v in range(height):
        y = (v + 0.5 - camera.cy) / camera.fy
        for axis in range(3):
            first[v, axis] = camera.axes[0, axis] * x + camera.axes[1, axis] * y + camera.axes[2, axis]
    return first


@njit(cache=True, fastmath={"contract"})
def _voxels_of_row(row, max_depth, first, step, origin, ny, nz, nowhere, index):
    """Fill ``index`` with the flat voxel index of each return in an image row, and ``nowhere`` for other pixels."""
    zero = np.float32(0)
    o0, o1, o2 = origin[0], origin[1], origin[2]
    a0, a1, a2 = first[0], first[1], first[2]
    b0, b1, b2 = step[0], step[1], step[2]
    for u in range(row.size):
        column = np.float32(np.int32(u))
        ends = (row[u] > zero) & (row[u] <= max_depth)
        d = row[u] if ends else zero
        i = np.int32(o0 + d * (a0 + b0 * column))
        j = np.int32(o1 + d * (a1 + b1 * column))
        k = np.int32(o2 + d * (a2 + b2 * column))
        # numba widens int32 sums and products; narrowing each step keeps the loop in 32-bit vectors.
        voxel = np.int32(np.int32(np.int32(np.int32(i * ny) + j) * nz) + k)
        index[u] = voxel if ends else nowhere


@njit(cache=True)
def _deepest_of_columns(depth, top, deepest):
    """Fill ``deepest`` with the greatest depth, m, of each column of the row of tiles that begins at row ``top``."""
    height, width = depth.shape
    for u in range(width):
        # Every element is written unconditionally: without AVX-512, conditional stores are not vectorised.
        greatest = np.float32(0)
        for i in range(TILE):
            d = depth[min(top + i, height - 1), u]
            greatest = d if d > greatest else greatest
        deepest[u] = greatest


@njit(cache=True)
def _deepest_of_tiles(deepest, max_depth, high):
    """Fill ``high`` with the greatest depth, at most ``max_depth``, of each tile in a row of tiles.

    ``deepest``: greatest depth of each column of the row of tiles.
    """
    for t in range(high.size):
        c = deepest[t * TILE : (t + 1) * TILE]
        greatest = max(max(max(c[0], c[1]), max(c[2], c[3])), max(max(c[4], c[5]), max(c[6], c[7])))
        high[t] = min(greatest, max_depth)


@njit(cache=True)
def _build_pyramid(high):
    """Fill the coarser levels: a tile of level n + 1 covers 2 × 2 tiles of level n, which has ⌈shape / 2ⁿ⌉ tiles."""
    levels, height, width = high.shape
    for level in range(1, levels):
        fine = high[level - 1]
        for i in range((height + 1) // 2):
            top, bottom = 2 * i, min(2 * i + 1, height - 1)
            for j in range((width + 1) // 2):
                left, right = 2 * j, min(2 * j + 1, width - 1)
                upper = max(fine[top, left], fine[top, right])
                lower = max(fine[bottom, left], fine[bottom, right])
                high[level, i, j] = max(upper, lower)
        height, width = (height + 1) // 2, (width + 1) // 2


@njit(cache=True)
def _mark_narrow(depth, camera, marks):
    """Trace a few rays where the view frustum is narrow: close to the camera, and along the frustum's four edges."""
    height, width = depth.shape
    x, y, z = camera.origin
    ax = camera.axes
    rows, columns = (
        _rays_across(height, camera.fy, camera.narrow_depth),
        _rays_across(width, camera.fx, camera.narrow_depth),
    )
    for i in range(rows):
        v = i * (height - 1) // (rows - 1)
        b = (v + 0.5 - camera.cy) / camera.fy
        for j in range(columns):
            u = j * (width - 1) // (columns - 1)
            a = (u + 0.5 - camera.cx) / camera.fx
            d = depth[v, u]
            if not 0 < d < np.inf:
                continue
            reach = min(d, camera.max_depth) - camera.margin
            if i % (rows - 1) != 0 or j % (columns - 1) != 0:
                reach = min(reach, camera.narrow_depth * camera.size)
            if reach > 0:
                x_stop = x + reach * (ax[0, 0] * a + ax[1, 0] * b + ax[2, 0])
                y_stop = y + reach * (ax[0, 1] * a + ax[1, 1] * b + ax[2, 1])
                z_stop = z + reach * (ax[0, 2] * a + ax[1, 2] * b + ax[2, 2])
                mark_line(x, y, z, x_stop, y_stop, z_stop, marks)


@njit(cache=True)
def _rays_across(pixels, focal, narrow_depth):
    """Number of rays across an image axis that are at most a voxel apart up to a depth of ``narrow_depth`` voxels."""
    return max(min(int(np.ceil(narrow_depth * pixels / focal)) + 1, pixels), 2)


@njit(cache=True)
def _mark_free(depth, camera, marks, high):
    """Mark as FREE every voxel that is not a HIT, has a corner seen by the camera, and is not partly hidden.

    Where free space is bounded by a plane (a surface, or the edge of the image or of a shadow), it overlaps a voxel
    only if it contains one of the voxel's corners. Testing the corners, each shared by eight voxels, is therefore as
    good as tracing all rays through a voxel. A voxel is partly hidden if one of its vertical edges has a seen and a
    hidden end. Rays then pass above or below the edge of a surface into the voxel, but the surface, level or sloping,
    may continue in the voxel at an angle so grazing that it gives no return.
    """
    metric = camera.axes * (camera.size * camera.size)  # m per voxel along each camera axis
    offsets = _corner_offsets(metric)
    sides = _view_normals(depth.shape, camera) @ metric
    spread, room = np.abs(metric).sum(axis=1) * (0.5 * BLOCK), np.abs(sides).sum(axis=1) * (0.5 * BLOCK)
    middle = metric.sum(axis=1) * (0.5 * BLOCK)
    pixels = depth.reshape(-1)
    pixel, deep = np.empty(CORNER_COUNT, np.int32), np.empty(CORNER_COUNT, np.float32)
    reach = np.empty(CORNER_COUNT, np.float32)
    seen = np.zeros(CORNER_COUNT + CORNERS_PER_SIDE * CORNERS_PER_SIDE, np.uint8)
    for i in range(0, marks.shape[0], BLOCK):
        for j in range(0, marks.shape[1], BLOCK):
            for k in range(0, marks.shape[2], BLOCK):
                x, y, z = i - camera.origin[0], j - camera.origin[1], k - camera.origin[2]
                if _lies_outside(x + 0.5 * BLOCK, y + 0.5 * BLOCK, z + 0.5 * BLOCK, sides, room):
                    continue
                r = metric[0, 0] * x + metric[0, 1] * y + metric[0, 2] * z
                d = metric[1, 0] * x + metric[1, 1] * y + metric[1, 2] * z
                w = metric[2, 0] * x + metric[2, 1] * y + metric[2, 2] * z
                if _may_be_seen(r + middle[0], d + middle[1], w + middle[2], spread, depth.shape, camera, high):
                    _project_corners(r, d, w, offsets, depth.shape, camera, pixel, deep)
                    if _flag_corners(pixels, camera, pixel, deep, reach, seen):
                        _join_corners(seen)
                        _mark_block(seen, marks[i : i + BLOCK, j : j + BLOCK, k : k + BLOCK])


@njit(cache=True)
def _view_normals(shape, camera):
    """(5, 3) inward normals, in camera axes, of planes through the optical centre that bound the field of view."""
    left, top = camera.cx / camera.fx, camera.cy / camera.fy
    right, bottom = shape[1] / camera.fx - left, shape[0] / camera.fy - top
    return np.array([(1.0, 0.0, left), (-1.0, 0.0, right), (0.0, 1.0, top), (0.0, -1.0, bottom), (0.0, 0.0, 1.0)])


@njit(cache=True)
def _lies_outside(x, y, z, sides, room):
    """Whether a block with its centre (x, y, z) voxels from the optical centre lies entirely outside the view."""
    outside = False
    for n in range(room.size):
        outside |= sides[n, 0] * x + sides[n, 1] * y + sides[n, 2] * z < -room[n]
    return outside


@njit(cache=True)
def _corner_offsets(metric):
    """(3, CORNERS) float32 vectors from a block's first corner to its voxels' corners, in camera axes, m."""
    offsets = np.empty((3, CORNER_COUNT), np.float32)
    for n in range(CORNER_COUNT):
        corner = min(n, CORNERS_PER_SIDE**3 - 1)
        i, j, k = (
            corner // (CORNERS_PER_SIDE * CORNERS_PER_SIDE),
            corner // CORNERS_PER_SIDE % CORNERS_PER_SIDE,
            corner % CORNERS_PER_SIDE,
        )
        for axis in range(3):
            offsets[axis, n] = metric[axis, 0] * i + metric[axis, 1] * j + metric[axis, 2] * k
    return offsets


@njit(cache=True)
def _may_be_seen(r, d, w, spread, shape, camera, high):
    """False if the cuboid (r, d, w) ± spread, m in camera axes, lies outside the image or behind all returns."""
    near, deep = max(w - spread[2], MIN_DEPTH), max(w + spread[2], MIN_DEPTH)
    if near + camera.margin >= camera.max_depth:
        return False
    u0, u1 = _pixel_interval(r, spread[0], near, deep, camera.fx, camera.cx)
    v0, v1 = _pixel_interval(d, spread[1], near, deep, camera.fy, camera.cy)
    if u0 >= shape[1] or v0 >= shape[0] or u1 < 0 or v1 < 0:
        return False
    return (
        _depth_bound(high, max(u0, 0), min(u1, shape[1] - 1), max(v0, 0), min(v1, shape[0] - 1))
        > near + camera.margin
    )


@njit(cache=True)
def _pixel_interval(x, half, near, deep, focal, centre):
    """First and last pixel along an image axis whose rays can meet a cuboid x ± half between depths near and deep."""
    a, b = x - half, x + half
    first = a / near if a < 0 else a / deep
    last = b / near if b > 0 else b / deep
    return int(np.floor(first * focal + centre)), int(np.floor(last * focal + centre))


@njit(cache=True)
def _depth_bound(high, u0, u1, v0, v1):
    """An upper bound on the depth of the pixels u0..u1 × v0..v1, m, from at most 3 × 3 tiles."""
    level, shift = 0, 3
    while (u1 >> shift) - (u0 >> shift) > 2 or (v1 >> shift) - (v0 >> shift) > 2:
        level, shift = level + 1, shift + 1
    deepest = np.float32(0)
    for i in range(v0 >> shift, (v1 >> shift) + 1):
        for j in range(u0 >> shift, (u1 >> shift) + 1):
            deepest = max(deepest, high[level, i, j])
    return deepest


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _project_corners(r0, d0, w0, offsets, shape, camera, pixel, deep):
    """Fill in the flat pixel index and the depth of a block's corners; the depth is NaN outside the image."""
    fx, fy, cx, cy = (np.float32(camera.fx), np.float32(camera.fy), np.float32(camera.cx), np.float32(camera.cy))
    r0, d0, w0 = np.float32(r0), np.float32(d0), np.float32(w0)
    zero, one, nowhere = np.float32(0), np.float32(1), np.float32(np.nan)
    right, bottom, row = np.float32(shape[1]), np.float32(shape[0]), np.int32(shape[1])
    rs, ds, ws = offsets[0], offsets[1], offsets[2]
    for n in range(CORNER_COUNT):
        w = w0 + ws[n]
        scale = one / w
        u = (r0 + rs[n]) * scale * fx + cx
        v = (d0 + ds[n]) * scale * fy + cy
        inside = (w > zero) & (u >= zero) & (v >= zero) & (u < right) & (v < bottom)
        u = u if inside else zero
        v = v if inside else zero
        pixel[n] = np.int32(np.int32(np.int32(v) * row) + np.int32(u))
        deep[n] = w if inside else nowhere


@njit(cache=True)
def _flag_corners(depth, camera, pixel, deep, reach, seen):
    """Set ``seen`` to SEEN if a ray reaches the corner, to HIDDEN if its return is missing or over a voxel nearer.

    Returns whether any corner is SEEN.
    """
    # Fetching the depths in a separate loop lets the comparison be vectorised.
    for n in range(CORNER_COUNT):
        reach[n] = depth[np.uint32(pixel[n])]
    max_depth, margin, size = np.float32(camera.max_depth), np.float32(camera.margin), np.float32(camera.size)
    zero, infinity = np.float32(0), np.float32(np.inf)
    any_seen = np.uint8(0)
    for n in range(CORNER_COUNT):
        d = reach[n]
        returns = (d > zero) & (d < infinity)
        d = d if d < max_depth else max_depth
        # Comparisons with NaN are false, so a corner outside the image is neither SEEN nor HIDDEN.
        is_seen = np.uint8(returns & (d - margin > deep[n]))
        is_hidden = np.uint8(((not returns) & (deep[n] > zero)) | (d + size < deep[n]))
        seen[n] = is_seen * SEEN + is_hidden * HIDDEN
        any_seen |= is_seen
    return any_seen != 0


@njit(cache=True)
def _join_corners(seen):
    """Turn the flags of corners into flags of voxels, in place: SEEN, and HIDDEN if the voxel is partly hidden."""
    for n in range(CORNER_COUNT):
        foot, top = seen[n], seen[n + 1]
        seen[n] = ((foot | top) & SEEN) | (((foot & (top << 1)) | (top & (foot << 1))) & HIDDEN)
    for stride in (CORNERS_PER_SIDE, CORNERS_PER_SIDE * CORNERS_PER_SIDE):
        for n in range(CORNER_COUNT):
            seen[n] |= seen[n + stride]


@njit(cache=True)
def _mark_block(seen, marks):
    """Mark as FREE the voxels of a block that are seen and not partly hidden, unless they are already marked."""
    for i in range(BLOCK):
        for j in range(BLOCK):
            for k in range(BLOCK):
                is_free = seen[(i * CORNERS_PER_SIDE + j) * CORNERS_PER_SIDE + k] == SEEN
                marks[i, j, k] = FREE if is_free & (marks[i, j, k] == 0) else marks[i, j, k]
