"""Compiled loops over the ground under the robot's wheels."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.arrays import Indices, Place
from sarsim.ground_truth.columns_kernels import vertical_cut

_MAX_ITERATIONS = 20
_GAP_TOLERANCE = 1e-6
"""Maximum remaining gap between wheels and ground, m."""
_SAMPLES = 20
"""Number of points on each side of the axle, front and rear, at which a tyre is tested for contact."""
_CONTACT_FRACTION = 0.75
"""Fraction of the radius over which the points extend; the outermost touch slopes of 48° and steps of 3.7 cm."""


class Ground(NamedTuple):
    """Convex bodies and the cells over which they lie.

    Attributes:
        planes: (M, 4) planes (n, d), with n·p ≤ d inside a body, m.
        first: (N + 1,) index of each body's first plane.
        start, number: (nx, ny) start and length of each cell's section of ``bodies``.
        bodies: indices of the bodies over each cell, cell by cell.
        origin: x, y of the corner of cell [0, 0], m.
        cell: edge length of a cell, m.
    """

    planes: NDArray[np.float64]
    first: NDArray[np.int64]
    start: NDArray[np.int64]
    number: NDArray[np.int64]
    bodies: Indices
    origin: Place
    cell: float


@njit(cache=True)
def ground_height(ground, x, y, below):
    """Height, m, of the highest surface at (x, y) that is not above ``below``; -inf if there is none."""
    i = int(np.floor((x - ground.origin[0]) / ground.cell))
    j = int(np.floor((y - ground.origin[1]) / ground.cell))
    highest = -np.inf
    if not (0 <= i < ground.start.shape[0] and 0 <= j < ground.start.shape[1]):
        return highest
    for k in range(ground.start[i, j], ground.start[i, j] + ground.number[i, j]):
        n = ground.bodies[k]
        low, top, _ = vertical_cut(ground.planes[ground.first[n] : ground.first[n + 1]], x, y)
        if low <= top and highest < top <= below:
            highest = top
    return highest


@njit(cache=True)
def axle_height(ground, x, y, c, s, radius, below):
    """Height, m, of the centre of a wheel at (x, y) that rolls along (c, s); -inf if there is no ground below it."""
    highest = -np.inf
    for k in range(-_SAMPLES, _SAMPLES + 1):
        along = radius * _CONTACT_FRACTION * k / _SAMPLES
        touched = ground_height(ground, x + c * along, y + s * along, below)
        highest = max(highest, touched + np.sqrt(radius * radius - along * along))
    return highest


@njit(cache=True)
def attitude(yaw, climb, rise):
    """(3, 3) rotation of a body at ``yaw``, rad, on slopes ``climb`` (forwards) and ``rise`` (leftwards), m per m."""
    c, s = np.cos(yaw), np.sin(yaw)
    x = np.array([c, s, climb]) / np.sqrt(1 + climb * climb)
    z = np.array([-climb * c + rise * s, -climb * s - rise * c, 1.0])
    z /= np.sqrt(climb * climb + rise * rise + 1)
    y = np.array([z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]])
    R = np.empty((3, 3))
    R[:, 0], R[:, 1], R[:, 2] = x, y, z
    return R


@njit(cache=True)
def rest_pose(ground, x, y, yaw, below, axles, radius, centre_of_mass):
    """Find the rest pose of a rigid body on those three of its four wheels that support the centre of mass.

    Args:
        ground: see :class:`Ground`.
        x, y, yaw: position and heading of the body, m and rad.
        below: height above which surfaces are not ground, m.
        axles: (4, 3) wheel centres in the body frame, m: front left, front right, rear left, rear right.
        radius: radius of the wheels, m.
        centre_of_mass: (3,) in the body frame, m.

    Returns:
        (z, climb, rise): height of the body's origin, m, and the body's slopes forwards and to the left, m per m; NaN
        if a wheel has no ground below it.
    """
    z, climb, rise = below, 0.0, 0.0
    half_length, half_width = axles[0, 0], axles[0, 1]
    gap = np.empty(4)
    for _ in range(_MAX_ITERATIONS):
        R = attitude(yaw, climb, rise)
        for w in range(4):
            centre = R @ axles[w]
            wheel_x, wheel_y = x + centre[0], y + centre[1]
            bearing = axle_height(ground, wheel_x, wheel_y, np.cos(yaw), np.sin(yaw), radius, below)
            gap[w] = bearing - z - centre[2]
        if not np.isfinite(gap).all():
            return np.nan, np.nan, np.nan
        forward = centre_of_mass[0] - centre_of_mass[2] * climb
        _lift(gap, axles, forward, centre_of_mass[1] - centre_of_mass[2] * rise)
        z += gap.mean()
        climb += (gap[0] + gap[1] - gap[2] - gap[3]) / (4 * half_length)
        rise += (gap[0] + gap[2] - gap[1] - gap[3]) / (4 * half_width)
        if np.abs(gap).max() < _GAP_TOLERANCE:
            break
    return z, climb, rise


@njit(cache=True)
def _lift(gap, axles, forward, left):
    """Set the gap of the wheel that is off the ground.

    (forward, left): the point of the body's ground plane vertically below the centre of mass, in the body frame, m.
    """
    twist = gap[0] + gap[3] - gap[1] - gap[2]
    # Both wheels on the diagonal with the higher ground touch the ground, and so does the wheel on the side of the
    # centre of mass.
    high = axles[0] if twist > 0 else axles[1]
    weight_is_left = high[0] * left - high[1] * forward > 0
    if twist > 0:
        hanging, across = (1, 2) if weight_is_left else (2, 1)
        gap[hanging] = gap[0] + gap[3] - gap[across]
    else:
        hanging, across = (3, 0) if weight_is_left else (0, 3)
        gap[hanging] = gap[1] + gap[2] - gap[across]


@njit(cache=True)
def is_clear(ground, x, y, z, R, below, underside):
    """Whether no point of ``underside``, (N, 3) in the body frame, m, is below the ground."""
    for n in range(len(underside)):
        p = R @ underside[n]
        if ground_height(ground, x + p[0], y + p[1], below) > z + p[2]:
            return False
    return True
