"""Compiled ray casting for exploration."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.arrays import MaskLayer, Place
from pipeline.geometry.cells_kernels import cell_at


class CameraView(NamedTuple):
    """The view of the ground from the camera of a level robot.

    Attributes:
        height, ahead: position of the camera, m above the ground and m in front of the robot's centre.
        near, far: minimum and maximum distance from the camera at which it sees the ground, m.
        lower_edge, upper_edge: angles of the image's edges above the horizon, rad.
        field_of_view: horizontal field of view, rad.
        min_grazing_angle: minimum angle between a ray and the ground for a return, rad.
        rays: number of directions, all around the robot, in which rays are cast.
    """

    height: float
    ahead: float
    near: float
    far: float
    lower_edge: float
    upper_edge: float
    field_of_view: float
    min_grazing_angle: float
    rays: int

    @property
    def step(self) -> float:
        """Angle from one ray to the next, rad."""
        return 2 * np.pi / self.rays

    @property
    def reach(self) -> float:
        """Distance from the robot beyond which nothing is seen, however the robot leans, m."""
        return self.far + self.height + self.ahead


class SearchedTerrain(NamedTuple):
    """The ground seen so far, and the targets of keyframes; layers are (nx, ny) on one grid.

    Attributes:
        origin: corner of cell [0, 0].
        cell: side of a cell, m.
        elevation: float32 m, height of the ground; NaN where unknown.
        gradient: (nx, ny, 2) float32 slope along x and y.
        target: bool, the unseen cells to be shown by keyframes.
        probability: float32, probability that a cell in view can be seen at all.
        missed_from: (nx, ny, 2) float32 position of the last look that missed the cell, m; inf if none did.
        falls: whether unknown ground behind the crest of a ramp is assumed to fall as steeply as the ramp rose.
        max_unknown_length: length of unknown ground that a ray is expected to see through, m.
        ramp_slope: slope above which ground is a ramp.
        nist_slope, level_run, min_new_view_distance: see ``VisibilityConfig``.
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
    max_unknown_length: float
    level_run: float
    min_new_view_distance: float


@njit(cache=True)
def cast_ray(x, y, level, bearing, tilt, view, terrain, seen):
    """Gain expected from a camera ray of a robot at (x, y, level), m, along ``bearing``, rad.

    The robot is pitched up by ``tilt``, rad, in this direction.

    The ray runs over the ground seen so far; a cell is hidden if a nearer one rises higher in the view. Unknown
    ground is assumed to continue at the last height seen or, if ``terrain.falls``, to fall behind the crest of a ramp
    as steeply as the ramp rose. Level ground seen behind the crest reduces this fall. Ground that a keyframe missed
    is assumed to fall as well. Ground seen at a grazing angle gives no return.

    Unknown ground is never more likely to be seen than the unknown ground just before it, which the ray must pass.

    Returns:
        The sum of the distances of the target cells in view, m, weighted by their probability; and the number of
        these cells, whose flat indices are written to ``seen``. The sum times the cell size and the angle between
        rays is an area.
    """
    nx, ny = terrain.elevation.shape
    origin, cell = terrain.origin, terrain.cell
    dx, dy = np.cos(bearing), np.sin(bearing)
    camera, ahead, horizon, ceiling = tilted_camera(level, tilt, view)
    unknown, fall = 0.0, fall_after(np.tan(tilt), terrain.falls, terrain.ramp_slope)
    levelling = terrain.nist_slope * cell / terrain.level_run
    total, count, probability = 0.0, 0, 1.0
    d = 0.5 * cell
    while d < view.far and unknown < terrain.max_unknown_length:
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
        # The probability is updated below the image, too, because ground that did not show from farther away is not
        # assumed to continue out of sight.
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
        if terrain.target[i, j] and is_shown(
            from_miss, d, slope, rise, view, terrain.min_new_view_distance, terrain.nist_slope
        ):
            total += d * min(probability, terrain.probability[i, j])
            seen[count] = i * ny + j
            count += 1
    return total, count


@njit(cache=True)
def height_and_tilt(x, y, bearing, terrain):
    """Height, m, of a robot that stands on the ground at (x, y), and its pitch along ``bearing``, rad."""
    i, j = cell_at(x, y, terrain.origin, terrain.cell)
    tilt = np.arctan(rise_along(i, j, np.cos(bearing), np.sin(bearing), terrain.gradient))
    return np.float64(terrain.elevation[i, j]), tilt


@njit(cache=True)
def tilted_camera(level, tilt, view):
    """Height of the camera and its distance ahead of the robot, m, and the slopes of its lowest and highest rays.

    The robot is at the height ``level``, m, on a slope that pitches the camera up by ``tilt``, rad.
    """
    height = level + view.height * np.cos(tilt) + view.ahead * np.sin(tilt)
    ahead = view.ahead * np.cos(tilt) - view.height * np.sin(tilt)
    return height, ahead, np.tan(tilt + view.lower_edge), np.tan(tilt + view.upper_edge)


# Functions called for each cell take numbers and layers; passing the entire terrain takes four times as long.
@njit(cache=True)
def rise_along(i, j, dx, dy, gradient):
    """Slope of the ground in cell (i, j) along the unit vector (dx, dy), from ``gradient`` (nx, ny, 2)."""
    return gradient[i, j, 0] * dx + gradient[i, j, 1] * dy


@njit(cache=True)
def fall_after(rise, falls, ramp_slope):
    """Slope at which unknown ground is assumed to fall behind ground that rises at the slope ``rise``."""
    return rise if falls and rise > ramp_slope else 0.0


@njit(cache=True)
def is_shown(from_miss, d, slope, rise, view, min_new_view_distance, nist_slope):
    """Whether a ray shows the ground that it meets at a horizontal distance of ``d`` m.

    ``slope`` is the slope of the ray, and ``rise`` is the slope of the ground along the ray. ``from_miss`` (2,) is
    the offset, m, of the robot from the last look that missed this ground; infinite if no look missed it.
    """
    ex, ey = from_miss
    if ex * ex + ey * ey < min_new_view_distance * min_new_view_distance:
        return False
    if np.isfinite(ex):
        # The ground may fall as steeply as a NIST ramp.
        rise = min(rise, -nist_slope)
    min_grazing_angle = np.arctan(rise) - np.arctan(slope)
    return min_grazing_angle >= view.min_grazing_angle and d * np.sqrt(1 + slope * slope) >= view.near


@njit(cache=True)
def ray_gains(places, view, terrain, wanted, earlier):
    """(N, R) m², area that each ray from points (N, 2) is expected to show; ``earlier`` where not ``wanted``."""
    result = earlier.copy()
    step = 2 * np.pi / view.rays
    seen = np.zeros(int(view.far / terrain.cell) + 2, np.int64)
    for n in range(len(places)):
        for m in range(view.rays):
            if wanted[n, m]:
                x, y = places[n]
                level, tilt = height_and_tilt(x, y, m * step, terrain)
                total, _ = cast_ray(x, y, level, m * step, tilt, view, terrain, seen)
                result[n, m] = total * terrain.cell * step
    return result


@njit(cache=True)
def are_towards(cells, mask, rays, side, count):
    """(N, R) bool, whether each of ``count`` rays from cells (N, 2) passes through any block of a mask (I, J).

    Blocks have ``side`` × ``side`` cells, where ``side`` is odd. ``rays`` (S, S, 2) is the half-open range of rays by
    the offset of a block's middle cell from the cell, which is at the centre of the array.
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
        level, tilt = height_and_tilt(x, y, bearing, terrain)
        _, count = cast_ray(x, y, level, bearing, tilt, view, terrain, seen)
        for n in range(count):
            result[seen[n]] = True
    return result.reshape(terrain.target.shape)


@njit(cache=True)
def count_misses(T, bearings, view, terrain, misses, missed):
    """Count the target cells along ``bearings``, rad, that a look from a 4×4 pose was expected to show but did not.

    Updated in place: ``misses`` (nx, ny), ``terrain.missed_from``, and ``missed`` (256,), the number of these cells
    by their number of earlier misses.
    """
    seen, most = np.zeros(int(view.far / terrain.cell) + 2, np.int64), len(missed) - 1
    x, y, level = T[:3, 3]
    for bearing in bearings:
        tilt = np.arctan(-(T[0, 2] * np.cos(bearing) + T[1, 2] * np.sin(bearing)) / T[2, 2])
        _, count = cast_ray(x, y, level, bearing, tilt, view, terrain, seen)
        for n in range(count):
            i, j = divmod(seen[n], terrain.target.shape[1])
            # Count a cell once, although several rays, or one ray at several positions, may show it.
            if terrain.missed_from[i, j, 0] != np.float32(x) or terrain.missed_from[i, j, 1] != np.float32(y):
                missed[misses[i, j]] += 1
                misses[i, j] = min(misses[i, j] + 1, most)
                terrain.missed_from[i, j, 0], terrain.missed_from[i, j, 1] = x, y
