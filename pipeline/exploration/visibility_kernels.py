"""Compiled ray casting for the exploration."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.arrays import MaskLayer, Place
from pipeline.elevation_map.elevation_kernels import cell_at


class CameraView(NamedTuple):
    """What the camera sees of the ground from a robot that stands level.

    Attributes:
        height, ahead: of the camera above the ground and before the robot's middle, m.
        near, far: distances from the camera at which it sees the ground, m.
        lower_edge, upper_edge: of the image, rad above the horizon.
        field_of_view: along the horizon, rad.
        grazing: least angle between a ray and ground that gives a return, rad.
        rays: number of directions all around in which rays are cast.
    """

    height: float
    ahead: float
    near: float
    far: float
    lower_edge: float
    upper_edge: float
    field_of_view: float
    grazing: float
    rays: int

    @property
    def step(self) -> float:
        """rad from one ray to the next."""
        return 2 * np.pi / self.rays

    @property
    def reach(self) -> float:
        """m; nothing farther from the robot is seen, however the robot leans."""
        return self.far + self.height + self.ahead


class SearchedTerrain(NamedTuple):
    """The ground that was seen, and the targets of keyframes; layers are (nx, ny) on one grid.

    Attributes:
        origin: corner of cell [0, 0].
        cell: side of a cell, m.
        elevation: float32 m, NaN where unknown.
        gradient: (nx, ny, 2) float32 slope along x and y.
        target: unseen ground that counts.
        probability: float32, probability that a cell in view can be seen at all.
        missed_from: (nx, ny, 2) float32 m, where the last keyframe that missed the cell was taken; inf if none did.
        falls: whether unknown ground behind the crest of a ramp is assumed to fall as the ramp rose.
        most_unknown: m of unknown ground that a ray is expected to see through.
        ramp_slope, nist_slope, level_run, new_view: see ``VisibilityConfig``.
    """

    origin: Place
    cell: float
    elevation: NDArray[np.float32]
    gradient: NDArray[np.float32]
    target: MaskLayer
    probability: NDArray[np.float32]
    missed_from: NDArray[np.float32]
    falls: bool
    ramp_slope: float
    nist_slope: float
    most_unknown: float
    level_run: float
    new_view: float


@njit(cache=True)
def cast_ray(x, y, bearing, view, terrain, seen):
    """What a ray of the camera of a robot at (x, y) is expected to show for the first time.

    The ray runs over the ground that was seen; a cell is hidden if something before it rises higher in the view.
    Unknown ground is assumed to continue at the last height seen, but if ``terrain.falls``, to fall behind the crest
    of a ramp as the ramp rose; ground that a keyframe missed is assumed to fall as well. Ground that is met at a
    grazing angle gives no return.

    Unknown ground is never likelier to be seen than the unknown ground right before it, which the ray must pass.

    Returns the summed distances of the target cells in view, weighted by their probability, and their number; times
    the step and the angle between rays the sum is an area. The flat indices of these cells are written to ``seen``.
    """
    nx, ny = terrain.elevation.shape
    origin, cell = terrain.origin, terrain.cell
    i, j = cell_at(x, y, origin, cell)
    level = terrain.elevation[i, j]
    dx, dy = np.cos(bearing), np.sin(bearing)
    tilt = np.arctan(rise_along(i, j, dx, dy, terrain.gradient))
    camera, ahead, horizon, ceiling = camera_on(level, tilt, view)
    unknown, fall = 0.0, fall_after(np.tan(tilt), terrain.falls, terrain.ramp_slope)
    levelling = terrain.nist_slope * cell / terrain.level_run
    total, count, probability = 0.0, 0, 1.0
    d = 0.5 * cell
    while d < view.far and unknown < terrain.most_unknown:
        d += cell
        i, j = cell_at(x + (d + ahead) * dx, y + (d + ahead) * dy, origin, cell)
        if not (0 <= i < nx and 0 <= j < ny):
            break
        is_unknown = np.isnan(terrain.elevation[i, j])
        if is_unknown:
            level -= fall * cell
            rise = -fall
        else:
            level = terrain.elevation[i, j]
            rise = rise_along(i, j, dx, dy, terrain.gradient)
            fall = max(fall_after(rise, terrain.falls, terrain.ramp_slope), fall - levelling)
        # Also below the view: ground that did not show from farther away is not assumed to continue out of sight.
        probability = min(probability, terrain.probability[i, j]) if is_unknown else 1.0
        slope = (level - camera) / d
        if slope > ceiling:
            break
        if slope < horizon - 0.01:
            continue
        horizon = max(horizon, slope)
        if is_unknown:
            unknown += cell
        from_miss = x - terrain.missed_from[i, j, 0], y - terrain.missed_from[i, j, 1]
        if terrain.target[i, j] and is_shown(from_miss, d, slope, rise, view, terrain.new_view, terrain.nist_slope):
            total += d * min(probability, terrain.probability[i, j])
            seen[count] = i * ny + j
            count += 1
    return total, count


@njit(cache=True)
def camera_on(level, tilt, view):
    """Height of the camera and its distance before the robot, m, and the slopes of its lowest and highest ray.

    The robot stands at the height ``level`` on a slope, by whose ``tilt`` the camera points up or down along it.
    """
    height = level + view.height * np.cos(tilt) + view.ahead * np.sin(tilt)
    ahead = view.ahead * np.cos(tilt) - view.height * np.sin(tilt)
    return height, ahead, np.tan(tilt + view.lower_edge), np.tan(tilt + view.upper_edge)


# Functions called for each cell get numbers and layers; passing the whole terrain takes four times as long.
@njit(cache=True)
def rise_along(i, j, dx, dy, gradient):
    """Slope of the ground in cell (i, j) along the unit direction (dx, dy), by its ``gradient`` (nx, ny, 2)."""
    return gradient[i, j, 0] * dx + gradient[i, j, 1] * dy


@njit(cache=True)
def fall_after(rise, falls, ramp_slope):
    """Slope at which unknown ground is assumed to fall behind ground that rises with the slope ``rise``."""
    return rise if falls and rise > ramp_slope else 0.0


@njit(cache=True)
def is_shown(from_miss, d, slope, rise, view, new_view, nist_slope):
    """Whether a ray shows what it meets at a horizontal distance of ``d`` m.

    The ray has the ``slope``, and the ground that it meets ``rise`` along it. The keyframe that last missed this
    ground was taken ``from_miss`` (2,) m away; inf if none was.
    """
    ex, ey = from_miss
    if ex * ex + ey * ey < new_view * new_view:
        return False
    if np.isfinite(ex):
        # It may fall away as a NIST ramp does.
        rise = min(rise, -nist_slope)
    grazing = np.arctan(rise) - np.arctan(slope)
    return grazing >= view.grazing and d * np.sqrt(1 + slope * slope) >= view.near


@njit(cache=True)
def ray_gains(places, view, terrain, wanted, earlier):
    """(N, R) m² that each ray from (N, 2) points should show: cast if ``wanted``, otherwise as ``earlier``."""
    result = earlier.copy()
    step = 2 * np.pi / view.rays
    seen = np.zeros(int(view.far / terrain.cell) + 2, np.int64)
    for n in range(len(places)):
        for m in range(view.rays):
            if wanted[n, m]:
                total, _ = cast_ray(places[n, 0], places[n, 1], m * step, view, terrain, seen)
                result[n, m] = total * terrain.cell * step
    return result


@njit(cache=True)
def rays_towards(cells, mask, rays, side, count):
    """(N, R) bool, which of ``count`` rays from cells (N, 2) that come through blocks of a mask (I, J).

    Blocks have ``side`` cells to each side, an odd number. ``rays`` (S, S, 2) are the first ray, and the first after
    the last, by the offset of a block's middle from the cell, which is in the middle of this square.
    """
    wanted = np.zeros((len(cells), count), np.bool_)
    most = len(rays) // 2
    for n in range(len(cells)):
        i, j = cells[n, 0] - side // 2, cells[n, 1] - side // 2
        for a in range(max(-((most - i) // side), 0), min((i + most) // side + 1, mask.shape[0])):
            for b in range(max(-((most - j) // side), 0), min((j + most) // side + 1, mask.shape[1])):
                if mask[a, b]:
                    first, last = rays[side * a - i + most, side * b - j + most]
                    for m in range(first, last):
                        wanted[n, m % count] = True
    return wanted


@njit(cache=True)
def cells_in_view(x, y, bearings, view, terrain):
    """(nx, ny) bool, the target cells that rays along ``bearings`` from (x, y) are expected to show."""
    result = np.zeros(terrain.target.size, np.bool_)
    seen = np.zeros(int(view.far / terrain.cell) + 2, np.int64)
    for bearing in bearings:
        _, count = cast_ray(x, y, bearing, view, terrain, seen)
        for n in range(count):
            result[seen[n]] = True
    return result.reshape(terrain.target.shape)


@njit(cache=True)
def count_misses(x, y, bearings, view, terrain, misses, missed):
    """Count the target cells that a keyframe from (x, y) should have shown along ``bearings`` and did not.

    Renewed in place: ``misses`` (nx, ny), ``terrain.missed_from``, and ``missed`` (256,), the number of such cells by
    their earlier misses.
    """
    seen, most = np.zeros(int(view.far / terrain.cell) + 2, np.int64), len(missed) - 1
    for bearing in bearings:
        _, count = cast_ray(x, y, bearing, view, terrain, seen)
        for n in range(count):
            i, j = divmod(seen[n], terrain.target.shape[1])
            # Once, although several rays, and a ray at several places, may show the cell.
            if terrain.missed_from[i, j, 0] != np.float32(x) or terrain.missed_from[i, j, 1] != np.float32(y):
                missed[misses[i, j]] += 1
                misses[i, j] = min(misses[i, j] + 1, most)
                terrain.missed_from[i, j, 0], terrain.missed_from[i, j, 1] = x, y
