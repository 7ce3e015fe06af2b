"""Compiled ray casting for the exploration."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.traversability.shortest_paths_kernels import is_aligned, is_traversable

RAMP = 0.14
"""Slope above which ground that rises is a ramp."""
SUSPECTED_FALL = 0.28
"""Slope at which ground that a look did not show may fall away: a NIST ramp's, 16°."""
FORGET = 0.3
"""1/m, how fast level ground after a ramp takes away the expectation that it falls again."""

HALF_LENGTH, HALF_WIDTH = 0.274, 0.269
"""m of a Pioneer 3-AT, and 0.02 m more: it heads a few degrees off the line that it follows."""


class Sight(NamedTuple):
    """How the camera sees the ground: see :class:`pipeline.exploration.next_best_view.ExplorationConfig`."""

    camera_height: float
    camera_ahead: float
    near: float
    far: float
    lower_edge: float
    upper_edge: float
    min_grazing: float
    max_unknown: float

    @property
    def reach(self) -> float:
        """m; nothing farther from the robot is seen, however it leans."""
        return self.far + self.camera_height + self.camera_ahead


class Ground(NamedTuple):
    """What is known of the ground, and what is worth a look; layers are (nx, ny) on one grid.

    Attributes:
        origin: (2,) corner of cell [0, 0], m.
        cell: side of a cell, m.
        elevation: float32 m, NaN where unknown.
        gradient: (nx, ny, 2) float32 slope along x and y.
        target: bool, unseen ground that counts.
        hope: float32, how likely a look shows a target at all: it counts for so much.
        missed_from: (nx, ny, 2) float32, from where the last look for a target was in vain, m.
        blind_radius: around it the target does not count, m.
    """

    origin: NDArray[np.float64]
    cell: float
    elevation: NDArray[np.float32]
    gradient: NDArray[np.float32]
    target: NDArray[np.bool_]
    hope: NDArray[np.float32]
    missed_from: NDArray[np.float32]
    blind_radius: float


@njit(cache=True)
def cast_ray(x, y, bearing, sight, ground, seen):
    """What a ray of the camera of a robot at (x, y) is expected to show for the first time.

    The ray runs over the known ground; a cell is hidden where something before it rises higher in the view. Unknown
    ground is believed to go on at the last known height, but behind the crest of a ramp to fall as it rose, and
    so is ground that was looked for in vain. What is met at a grazing angle sends nothing back.

    Returns the summed distances of the target cells in view, weighed by hope, and their number; times the step and
    the angle between rays the sum is an area. Their flat indices go to ``seen``.
    """
    nx, ny = ground.elevation.shape
    origin, cell = ground.origin, ground.cell
    i, j = int((x - origin[0]) / cell), int((y - origin[1]) / cell)
    level = ground.elevation[i, j]
    dx, dy = np.cos(bearing), np.sin(bearing)
    # On a slope the robot looks up or down along it.
    tilt = np.arctan(ground.gradient[i, j, 0] * dx + ground.gradient[i, j, 1] * dy)
    camera = level + sight.camera_height * np.cos(tilt) + sight.camera_ahead * np.sin(tilt)
    ahead = sight.camera_ahead * np.cos(tilt) - sight.camera_height * np.sin(tilt)
    horizon, ceiling = np.tan(tilt + sight.lower_edge), np.tan(tilt + sight.upper_edge)
    unknown, fall = 0.0, np.tan(tilt) if np.tan(tilt) > RAMP else 0.0
    total, count = 0.0, 0
    d = max(0.35 - ahead, 0.5 * cell)
    while d < sight.far and unknown < sight.max_unknown:
        d += cell
        r = d + ahead
        i = int(np.floor((x + r * dx - origin[0]) / cell))
        j = int(np.floor((y + r * dy - origin[1]) / cell))
        if not (0 <= i < nx and 0 <= j < ny):
            break
        is_unknown = np.isnan(ground.elevation[i, j])
        if is_unknown:
            level -= fall * cell
            rise = -fall
        else:
            level = ground.elevation[i, j]
            rise = ground.gradient[i, j, 0] * dx + ground.gradient[i, j, 1] * dy
            fall = max(rise if rise > RAMP else 0.0, fall - FORGET * cell)
        slope = (level - camera) / d
        if slope > ceiling:
            break
        if slope < horizon - 0.01:
            continue
        horizon = max(horizon, slope)
        if is_unknown:
            unknown += cell
        if not ground.target[i, j] or is_blind(x, y, i, j, ground):
            continue
        if ground.hope[i, j] < 1:
            rise = min(rise, -SUSPECTED_FALL)
        grazing = np.arctan(rise) - np.arctan(slope)
        if grazing >= sight.min_grazing and d * np.sqrt(1 + slope * slope) >= sight.near:
            total += d * ground.hope[i, j]
            seen[count] = i * ny + j
            count += 1
    return total, count


@njit(cache=True)
def is_blind(x, y, i, j, ground):
    """Whether an earlier look from near (x, y) did not show cell (i, j)."""
    ex, ey = x - ground.missed_from[i, j, 0], y - ground.missed_from[i, j, 1]
    return ex * ex + ey * ey < ground.blind_radius**2


@njit(cache=True)
def ray_areas(places, rays, sight, ground):
    """(N, rays) m² of target area that each ray of the circle is expected to show from each of (N, 2) points."""
    areas = np.zeros((len(places), rays))
    seen = np.zeros(int(sight.far / ground.cell) + 9, np.int64)
    step = 2 * np.pi / rays
    for n in range(len(places)):
        for m in range(rays):
            total, _ = cast_ray(places[n, 0], places[n, 1], m * step, sight, ground, seen)
            areas[n, m] = total * ground.cell * step
    return areas


@njit(cache=True)
def touches(x, y, dx, dy, hazard):
    """Whether a corner of the chassis of a robot at (x, y) cells that heads along (dx, dy) cells/m is in a hazard."""
    for ahead in (-HALF_LENGTH, HALF_LENGTH):
        for left in (-HALF_WIDTH, HALF_WIDTH):
            i = int(np.floor(x + ahead * dx - left * dy))
            j = int(np.floor(y + ahead * dy + left * dx))
            if 0 <= i < hazard.shape[0] and 0 <= j < hazard.shape[1] and hazard[i, j]:
                return True
    return False


@njit(cache=True)
def straight_ways(places, rays, longest, turnable, hazard, rules, origin, cell):
    """(N, rays) m that the robot drives straight to (N, 2) points from the nearest place where it can turn.

    Along each ray of the circle, from behind; inf where no straight way no longer than ``longest`` leads from such a
    place. ``turnable`` (nx, ny) says where it can turn, ``hazard`` (nx, ny) what the corners of its chassis must not
    meet on the way. It meets ramps head-on.
    """
    ways = np.full((len(places), rays), np.inf)
    for n in range(len(places)):
        for m in range(rays):
            dx, dy = np.cos(m * 2 * np.pi / rays), np.sin(m * 2 * np.pi / rays)
            for k in range(int(2 * longest / cell) + 1):
                s = 0.5 * cell * k
                x, y = places[n, 0] - s * dx - origin[0], places[n, 1] - s * dy - origin[1]
                i, j = int(np.floor(x / cell)), int(np.floor(y / cell))
                if not is_traversable(i, j, rules) or not is_aligned(dx, dy, i, j, rules):
                    break
                if touches(x / cell, y / cell, dx / cell, dy / cell, hazard):
                    break
                if turnable[i, j]:
                    ways[n, m] = s
                    break
    return ways


@njit(cache=True)
def view_gains(areas, rays_in_view):
    """(N, rays) m² in view along each ray of the circle, the middle one of ``rays_in_view``."""
    gains = np.zeros_like(areas)
    rays, half = areas.shape[1], rays_in_view // 2
    for n in range(len(areas)):
        for m in range(rays):
            for k in range(-half, half + 1):
                gains[n, m] += areas[n, (m + k) % rays]
    return gains


@njit(cache=True)
def cells_in_view(x, y, bearings, sight, ground):
    """(nx, ny) bool, the target cells that rays along ``bearings`` from (x, y) are expected to show."""
    result = np.zeros(ground.target.size, np.bool_)
    seen = np.zeros(int(sight.far / ground.cell) + 9, np.int64)
    for bearing in bearings:
        _, count = cast_ray(x, y, bearing, sight, ground, seen)
        for n in range(count):
            result[seen[n]] = True
    return result.reshape(ground.target.shape)
