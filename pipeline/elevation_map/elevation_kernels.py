"""Compiled loops of the elevation map and of traversability."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.elevation_map.depth_dropouts_kernels import ROW_STEP
from pipeline.geometry.cells_kernels import cell_at

MAX_HITS = np.iinfo(np.uint16).max
"""Number of returns at which the count of a bin saturates."""
NO_COLUMN = -1
"""Row of a cell without returns, which has no column."""
COMPLETE_FRACTION = 0.9
"""Fraction of a cell's pixels whose returns show that no panel 1 cm thick stands in it, which would hide a fifth."""
_DIRECTIONS = ((1, 0), (0, 1), (1, 1), (1, -1))


class Columns(NamedTuple):
    """Parameters of the columns, and of the search for the ground in them.

    Attributes:
        bin: height of each bin, m.
        headroom: free height above the ground, m.
        min_returns: see :class:`pipeline.elevation_map.config.ElevationConfig`.
        stray_fraction: fraction of a bin's returns that may stray into an adjacent bin.
    """

    bin: float
    headroom: float
    min_returns: int
    stray_fraction: float


class Bins(NamedTuple):
    """The bins of the cells' columns; cells without returns have no column.

    Attributes:
        row: (nx, ny) int32, row of each cell's column in the other arrays; ``NO_COLUMN`` without one.
        lowest: (M,) float64 m, height in ``map`` of the lower edge of each column's lowest bin; NaN while the column
            has no returns.
        height: (M, levels) float32 m, mean height of the returns in each bin.
        hits: (M, levels) uint16, number of returns in each bin.
    """

    row: NDArray[np.int32]
    lowest: NDArray[np.float64]
    height: NDArray[np.float32]
    hits: NDArray[np.uint16]


@njit(cache=True, nogil=True)
def add_to_bins(points, counts, origin, cell, within, columns, bins, number, lowest, returns):
    """Add points (N, 3), m, to the bins; return their cells, (K, 2) int64, and the new number of columns.

    Each point is the mean of ``counts`` (N,) returns; (``origin``, ``cell``) is the grid. ``returns`` (nx, ny),
    initially 0, counts the returns in each cell. ``number`` is the old number of columns; there is room for N more.
    Columns without returns begin at ``lowest``, m. As in the other functions that take ``within`` (nx, ny), only
    cells in this mask change.
    """
    (nx, ny), nz = returns.shape, bins.height.shape[1]
    cells, size = np.empty((len(points), 2), np.int64), 0
    for n in range(points.shape[0]):
        z = points[n, 2]
        i, j = cell_at(points[n, 0], points[n, 1], origin, cell)
        if not (0 <= i < nx and 0 <= j < ny and within[i, j]):
            continue
        row = bins.row[i, j]
        bottom = lowest if row == NO_COLUMN or np.isnan(bins.lowest[row]) else bins.lowest[row]
        k = int(np.floor((z - bottom) / columns.bin))
        if not 0 <= k < nz:
            continue
        if row == NO_COLUMN:
            row = bins.row[i, j] = number
            number += 1
        bins.lowest[row] = bottom
        count, height, hits = np.int64(counts[n]), bins.height[row], bins.hits[row]
        total = min(hits[k] + count, MAX_HITS)
        hits[k] = total
        height[k] += (z - height[k]) * min(count / total, 1.0)
        if returns[i, j] == 0:
            cells[size, 0], cells[size, 1] = i, j
            size += 1
        returns[i, j] += count
    return cells[:size], number


@njit(cache=True, nogil=True)
def lower_to_lowest(points, chosen, origin, cell, within, lowest):
    """Lower ``lowest`` (nx, ny), m, to the lowest ``chosen`` (N,) point in each cell; points are (N, 3), m."""
    nx, ny = lowest.shape
    for n in range(len(points)):
        i, j = cell_at(points[n, 0], points[n, 1], origin, cell)
        if chosen[n] and 0 <= i < nx and 0 <= j < ny and within[i, j]:
            lowest[i, j] = min(lowest[i, j], points[n, 2])


@njit(cache=True)
def column_height(bins, i, j, columns):
    """Height in m of the lowest surface with enough headroom in the column of a cell; NaN if nothing was measured.

    Filled bins with less than the headroom between them form one body. The height is the mean of a body thinner than
    half a bin, such as a sloping or noisy floor, and the top of a thicker one, such as an obstacle. A bin with few
    hits next to a bin with many hits is noise of the latter.
    """
    if bins.row[i, j] == NO_COLUMN:
        return np.nan
    height, hits = bins.height[bins.row[i, j]], bins.hits[bins.row[i, j]]
    bottom, top = np.nan, np.nan
    total, weight = 0.0, 0.0
    for k in range(height.shape[0]):
        beside = max(hits[k - 1] if k > 0 else 0, hits[k + 1] if k + 1 < len(hits) else 0)
        if hits[k] < columns.min_returns or hits[k] < columns.stray_fraction * beside:
            continue
        if not np.isnan(top) and height[k] - top >= columns.headroom:
            break
        if np.isnan(bottom):
            bottom = height[k]
        top = height[k]
        total += hits[k] * height[k]
        weight += hits[k]
    if top - bottom < 0.5 * columns.bin:
        return total / weight
    return top


@njit(cache=True, nogil=True)
def count_dropouts(points, counts, origin, cell, within, columns, bins, dropouts):
    """Count the dropouts in each cell, and return the cells that contain any, (K, 2) int64.

    Each of the points (N, 3), m, is the mean of ``counts`` (N,) dropouts. Only points within two bins of the ground,
    or over unknown ground, are counted. The numbers are added to ``dropouts`` (nx, ny), initially 0.
    """
    nx, ny = dropouts.shape
    cells, size = np.empty((len(points), 2), np.int64), 0
    for n in range(points.shape[0]):
        i, j = cell_at(points[n, 0], points[n, 1], origin, cell)
        if not (0 <= i < nx and 0 <= j < ny and within[i, j]):
            continue
        if abs(points[n, 2] - column_height(bins, i, j, columns)) > 2 * columns.bin:
            continue
        if dropouts[i, j] == 0:
            cells[size, 0], cells[size, 1] = i, j
            size += 1
        dropouts[i, j] += counts[n]
    return cells[:size]


@njit(cache=True)
def update_dropouts(direction, extent, dropouts, returns, cells, camera, level, grazing, origin, cell, columns, bins):
    """Mark the cells in which a keyframe has dropouts, and clear cells whose ground it shows.

    ``direction`` (nx, ny, 2) is the horizontal direction in which a cell's last dropout was seen, 0 where there is
    none, and ``extent`` (nx, ny) the cell's size in that keyframe's image, scaled to be independent of the distance.
    ``dropouts`` and ``returns`` (nx, ny) are the numbers of pixels without and with returns in ``cells`` (K, 2) of a
    keyframe taken from ``camera`` (3,), m; dropouts are searched for in every ``ROW_STEP``-th row only. At least
    ``columns.min_returns`` dropouts mark a cell. Ground of unknown height is assumed to be at ``level``, m.

    A mark is cleared by at least ``columns.min_returns`` returns without any dropout, if the keyframe was taken from
    another direction, or if there are about as many returns as the cell has pixels. A panel without returns is seen
    within ``grazing``, rad, of its plane; from a direction that differs by more than twice this angle, it would give
    returns. From any direction, it hides some ground.
    """
    for i, j in cells:
        has_dropouts = dropouts[i, j] >= columns.min_returns
        is_marked = direction[i, j, 0] != 0.0 or direction[i, j, 1] != 0.0
        may_refute = is_marked and dropouts[i, j] == 0 and returns[i, j] >= columns.min_returns
        if not (has_dropouts or may_refute):
            continue
        dx, dy = origin[0] + (i + 0.5) * cell - camera[0], origin[1] + (j + 0.5) * cell - camera[1]
        distance = np.sqrt(dx * dx + dy * dy) + 1e-9
        dx, dy = dx / distance, dy / distance
        # The image of level ground shrinks with the cube of its distance, and grows with the camera's height.
        ground = column_height(bins, i, j, columns)
        height = max(camera[2] - (level if np.isnan(ground) else ground), cell)
        pixels = ROW_STEP * dropouts[i, j] + returns[i, j]
        size = pixels * (distance * distance + height * height) ** 1.5 / height
        is_elsewhere = abs(dx * direction[i, j, 0] + dy * direction[i, j, 1]) < np.cos(2 * grazing)
        if has_dropouts:
            direction[i, j, 0], direction[i, j, 1] = dx, dy
            extent[i, j] = size
        elif is_elsewhere or size >= COMPLETE_FRACTION * extent[i, j]:
            direction[i, j, 0], direction[i, j, 1] = 0.0, 0.0


@njit(cache=True, nogil=True)
def lowest_rays(points, counts, camera, cell, ray_height, min_returns):
    """(R, 3) float32 m, lowest point in each cell of a fine grid on rays from ``camera`` (3,) to ``points`` (N, 3).

    The grid is so fine that each cell of ``cell`` m contains the centre of at least one fine cell. Fine cells in
    which the keyframe has ``min_returns`` returns or more are left out; ``counts`` (N,) is the number of returns per
    point. Because of noise, each ray is followed back only from a cell before its return, up to ``ray_height`` m
    above the return.
    """
    step = cell / np.sqrt(2.0)
    x0, y0, x1, y1 = camera[0], camera[1], camera[0], camera[1]
    for n in range(len(points)):
        x0, x1 = min(x0, points[n, 0]), max(x1, points[n, 0])
        y0, y1 = min(y0, points[n, 1]), max(y1, points[n, 1])
    origin = np.array([x0, y0])
    shape = int((x1 - x0) / step) + 1, int((y1 - y0) / step) + 1
    lowest, returns = np.full(shape, np.inf, np.float32), np.zeros(shape, np.int64)
    for n in range(len(points)):
        i, j = cell_at(points[n, 0], points[n, 1], origin, step)
        returns[i, j] += counts[n]
        dx, dy, dz = camera[0] - points[n, 0], camera[1] - points[n, 1], camera[2] - points[n, 2]
        steps = np.sqrt(dx * dx + dy * dy) / step
        for k in range(2, int(steps * min(ray_height / max(dz, 1e-6), 1.0)) + 1):
            i, j = cell_at(points[n, 0] + dx * k / steps, points[n, 1] + dy * k / steps, origin, step)
            lowest[i, j] = min(lowest[i, j], points[n, 2] + dz * k / steps)
    rays, size = np.empty((lowest.size, 3), np.float32), 0
    for i in range(shape[0]):
        for j in range(shape[1]):
            if lowest[i, j] < np.inf and returns[i, j] < min_returns:
                rays[size, 0], rays[size, 1] = x0 + (i + 0.5) * step, y0 + (j + 0.5) * step
                rays[size, 2] = lowest[i, j]
                size += 1
    return rays[:size]


@njit(cache=True, nogil=True)
def lower_ceiling(ceiling, rays, origin, cell, within):
    """Lower ``ceiling`` (nx, ny), m, to points on rays, and return the cells of these points, (K, 2) int64.

    ``rays``: (R, 3) the points, m.
    """
    nx, ny = ceiling.shape
    cells, size = np.empty((len(rays), 2), np.int64), 0
    for n in range(len(rays)):
        i, j = cell_at(rays[n, 0], rays[n, 1], origin, cell)
        if 0 <= i < nx and 0 <= j < ny and within[i, j]:
            ceiling[i, j] = min(ceiling[i, j], rays[n, 2])
            cells[size, 0], cells[size, 1] = i, j
            size += 1
    return cells[:size]


@njit(cache=True, nogil=True)
def mark_swept(cells, poses, disc, within, been, swept):
    """Set bits ``poses`` (K,) of ``cells`` (K, 2) in ``been``; mark the ``disc`` (D, 2) around each in ``swept``.

    ``been`` and ``swept`` are (nx, ny); ``disc`` holds the offsets of cells, all of which must be on the grid.
    """
    for k in range(len(cells)):
        i, j = cells[k]
        if within[i, j]:
            been[i, j] |= poses[k]
        for di, dj in disc:
            swept[i + di, j + dj] |= within[i + di, j + dj]


@njit(cache=True, nogil=True)
def clear_poses(cells, offsets, distances, within, been):
    """Clear in ``been`` (nx, ny) the bits of the poses whose footprint would contain one of the ``cells`` (K, 2).

    See :func:`pose_kernels.footprint_distances` for ``offsets`` (N, 2) and ``distances`` (N, 16).
    """
    nx, ny = been.shape
    for i, j in cells:
        for n in range(len(offsets)):
            a, b = i - offsets[n, 0], j - offsets[n, 1]
            if 0 <= a < nx and 0 <= b < ny and within[a, b]:
                for h in range(distances.shape[1]):
                    if distances[n, h] <= 0:
                        been[a, b] &= ~(np.uint16(1) << np.uint16(h))


@njit(cache=True, nogil=True)
def update_elevation(bins, cells, columns, elevation):
    """Recompute ``elevation`` (nx, ny), m, in ``cells`` (K, 2)."""
    for i, j in cells:
        elevation[i, j] = column_height(bins, i, j, columns)


@njit(cache=True)
def cells_to_known(elevation, i, j, di, dj, max_gap, dropout=None):
    """Number of steps along (di, dj) from cell (i, j) to the next known cell of ``elevation`` (nx, ny).

    The number is 0 if more than ``max_gap`` unknown cells, a ``dropout`` (nx, ny) cell or the border come first.
    """
    for gap in range(1, max_gap + 2):
        a, b = i + gap * di, j + gap * dj
        if not (a < elevation.shape[0] and 0 <= b < elevation.shape[1]):
            return 0
        if dropout is not None and dropout[a, b]:
            return 0
        if not np.isnan(elevation[a, b]):
            return gap
    return 0


@njit(cache=True, nogil=True)
def bridge_gaps(elevation, dropout, ceiling, max_gap, level, ray_height):
    """(nx, ny) m, ``elevation`` with unknown cells filled between two known ones that differ by at most ``level`` m.

    Gaps run along the axes and diagonals over at most ``max_gap`` cells; where several gaps cross, the last one
    determines the height. A cell is filled only if a ray passed over it, at ``ceiling`` (nx, ny), m, at most
    ``ray_height`` m above the ground. Elsewhere, there may be a thin wall that was seen from neither side. Nothing is
    filled across a ``dropout`` (nx, ny) cell.
    """
    filled = elevation.copy()
    nx, ny = elevation.shape
    for di, dj in _DIRECTIONS:
        for i in range(nx):
            for j in range(ny):
                if np.isnan(elevation[i, j]):
                    continue
                gap = cells_to_known(elevation, i, j, di, dj, max_gap, dropout)
                rise = elevation[i + gap * di, j + gap * dj] - elevation[i, j]
                for k in range(1, gap if abs(rise) <= level else 0):
                    a, b, ground = i + k * di, j + k * dj, elevation[i, j] + rise * k / gap
                    if ceiling[a, b] <= ground + ray_height:
                        filled[a, b] = ground
    return filled


@njit(cache=True, nogil=True)
def fill_pockets(elevation, dropout, most, level):
    """(nx, ny) m, ``elevation`` in which pockets of unknown cells too small for a wheel or a wall are filled.

    A pocket is at most ``most`` cells long and wide, and the known cells all around it differ by at most ``level`` m.
    It is filled at their mean height. Pockets that contain or touch a ``dropout`` (nx, ny) cell are not filled.

    Where frames end on all sides of a pocket, it remains unseen, and no ray passes over it. A wall that is seen
    end-on, in contrast, leaves a gap as long as the wall, and known ground does not surround this gap.
    """
    filled = elevation.copy()
    nx, ny = elevation.shape
    for i in range(nx):
        for j in range(ny):
            if np.isnan(elevation[i, j]) and not dropout[i, j]:
                low, high, mean = _heights_around_pocket(elevation, dropout, i, j, most)
                if high - low <= level:
                    filled[i, j] = mean
    return filled


@njit(cache=True, nogil=True)
def _heights_around_pocket(elevation, dropout, i, j, most):
    """Lowest, highest and mean height, m, around the pocket with cell (i, j); -inf, inf, NaN without a pocket."""
    nx, ny = elevation.shape
    i0, i1, j0, j1 = i, i, j, j
    while True:
        if i1 - i0 >= most or j1 - j0 >= most or i0 < 1 or j0 < 1 or i1 + 1 >= nx or j1 + 1 >= ny:
            return -np.inf, np.inf, np.nan
        low, high, total, is_closed = np.inf, -np.inf, 0.0, True
        a0, a1, b0, b1 = i0, i1, j0, j1
        for a in range(a0 - 1, a1 + 2):
            # The ring contains all of its first and last rows, but only the ends of the others.
            step = 1 if a < a0 or a > a1 else b1 - b0 + 2
            for b in range(b0 - 1, b1 + 2, step):
                if dropout[a, b]:
                    return -np.inf, np.inf, np.nan
                if np.isnan(elevation[a, b]):
                    i0, i1, j0, j1 = min(i0, a), max(i1, a), min(j0, b), max(j1, b)
                    is_closed = False
                    continue
                low, high, total = min(low, elevation[a, b]), max(high, elevation[a, b]), total + elevation[a, b]
        if is_closed:
            return low, high, total / (2 * (i1 - i0 + j1 - j0) + 8)


@njit(cache=True)
def step_hazards(elevation, max_gap, max_step, steepest):
    """(nx, ny) bool, the higher cells of steps and drops in ``elevation`` (nx, ny), m.

    A step is a pair of 8-connected neighbours that differ by more than ``max_step`` m, in addition to the slope on
    both sides, see :func:`continued_rise`. A drop is a pair of known cells along an axis or diagonal, with up to
    ``max_gap`` unknown cells in between. The heights of the two differ by more than ``max_step`` m plus a slope of
    ``steepest`` m per cell.
    """
    nx, ny = elevation.shape
    hazard = np.zeros((nx, ny), np.bool_)
    for di, dj in _DIRECTIONS:
        stretch = np.sqrt(di * di + dj * dj)
        for i in range(nx):
            for j in range(ny):
                if np.isnan(elevation[i, j]):
                    continue
                gap = cells_to_known(elevation, i, j, di, dj, max_gap)
                a, b = i + gap * di, j + gap * dj
                rise = elevation[a, b] - elevation[i, j]
                if gap <= 1:
                    rise -= continued_rise(elevation, i, j, a, b, steepest * stretch)
                most = max_step if gap <= 1 else max_step + steepest * gap * stretch
                hazard[a, b] |= rise > most
                hazard[i, j] |= rise < -most
    return hazard


@njit(cache=True)
def continued_rise(elevation, i, j, a, b, most):
    """Rise of the ground, m, that continues both before cell (i, j) and behind its neighbour (a, b).

    This is the smaller of the two rises, with its sign, and at most ``most`` m; 0 if either is unknown or their signs
    differ.
    """
    nx, ny = elevation.shape
    c, d, e, f = 2 * i - a, 2 * j - b, 2 * a - i, 2 * b - j
    if not (0 <= c < nx and 0 <= d < ny and 0 <= e < nx and 0 <= f < ny):
        return 0.0
    before, behind = elevation[i, j] - elevation[c, d], elevation[e, f] - elevation[a, b]
    if not before * behind > 0:
        return 0.0
    return np.sign(before) * min(abs(before), abs(behind), most)


@njit(cache=True)
def is_behind_step(elevation, i, j, di, dj, rise, noise):
    """Whether two adjacent cells between (i, j) and its neighbour (i + di, j + dj) differ by more than a slope does.

    ``rise``: rise of the steepest slope per cell, m, to which ``noise`` m is added.
    """
    steps = max(abs(di), abs(dj))
    before = elevation[i, j]
    for step in range(1, steps + 1):
        here = elevation[i + round(di * step / steps), j + round(dj * step / steps)]
        if abs(here - before) > rise * np.sqrt(di * di + dj * dj) / steps + noise:
            return True
        before = here
    return False


@njit(cache=True)
def gradients(elevation, cell, radius, surface_slope, surface_rise):
    """(nx, ny, 2) slopes along x and y of the least-squares plane through each cell's neighbourhood; 0 where unknown.

    The neighbourhood is a disc of ``radius`` cells. Neighbours that differ in height by more than ``surface_slope`` m
    per m plus ``surface_rise`` m belong to another surface, and so does what is behind such a step.
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
                    if np.isnan(dz) or abs(dz) > surface_slope * np.sqrt(x * x + y * y) + surface_rise:
                        continue
                    # Neighbours at the same height do not change the slope, so the search for a step is saved.
                    is_level = abs(dz) <= surface_rise
                    if not is_level and is_behind_step(elevation, i, j, di, dj, surface_slope * cell, surface_rise):
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
