"""Compiled geometry of a footprint with a heading: its clearance, and the costs of moves."""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.arrays import Layer, MaskLayer, Place
from pipeline.geometry.cells_kernels import cell_at

_HALF_VECTORS = np.array([(1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1)])
VECTORS = np.concatenate([_HALF_VECTORS, -_HALF_VECTORS])
"""(16, 2) displacement of a move along each heading, cells; the headings are lattice directions, 18 to 27° apart."""
HEADINGS, ORIENTATIONS = len(VECTORS), len(_HALF_VECTORS)
"""Number of headings, and number of headings with different footprints, because opposite headings have the same
footprint."""
HEADING_ANGLES = np.arctan2(*VECTORS.T[::-1]) % math.tau
"""(16,) rad, the headings as angles."""
UNKNOWN, HAZARD = 1, 2
"""Kinds of obstacles; 0 means none."""
BUCKETS = 8192
"""Number of buckets in the search's queue; every move costs fewer ticks."""


class Terrain(NamedTuple):
    """The ground on which the costs of moves depend; layers are (nx, ny) on one grid.

    Attributes:
        origin: (2,) lower corner of cell [0, 0], m.
        cell: side of a cell, m.
        leniency: distance by which the robot may come closer to unknown ground than to a hazard, m.
        turn_allowance: distance by which a turn to the next heading may come closer to an obstacle than the footprint
            at a pose may, cm.
        obstacle: uint8, 0, ``UNKNOWN`` or ``HAZARD``.
        to_obstacle: distance to the nearest obstacle, m.
        clearance: (nx, ny, 16) int8 cm, distance from the robot to the nearest obstacle, negative if the obstacle is
            inside. The first eight entries are for the footprint at each heading, the others for the area swept in a
            turn from each heading to the next. On and near a ramp, the clearance includes room as far downhill as the
            body leans and, in a turn, slides.
        required_clearance: int8 minimum allowed clearance, cm.
        ramp: cells in which the wheels may be on a ramp.
        uphill: (nx, ny, 2) gradient of this ramp, m per m; 0 where there is none.
        beside_people: bool, cells in which the robot drives no faster than ``speed_near_people``.
    """

    origin: Place
    cell: float
    leniency: float
    turn_allowance: int
    obstacle: NDArray[np.uint8]
    to_obstacle: Layer
    clearance: NDArray[np.int8]
    required_clearance: NDArray[np.int8]
    ramp: MaskLayer
    uphill: Layer
    beside_people: MaskLayer


class Costs(NamedTuple):
    """Parameters of the costs of a robot's moves.

    Attributes:
        half_length, half_width: half the length and width of the footprint, m.
        speed, ramp_speed: expected speeds on level ground with enough room, and on ramps, m/s.
        speed_near_people: maximum speed near people, m/s.
        turn_rate, ramp_turn_rate: expected turn rates on level ground and on ramps, rad/s.
        max_deviation: maximum deviation of the robot from its path, m.
        slope_deviation: additional deviation in a turn, m per unit of slope.
        slide: distance by which the robot slides downhill in a turn, m per unit of slope; the value for a quarter
            turn is used.
        lean: distance by which the body leans downhill, m per unit of slope, equal to the height at which the body is
            widest.
        cross_slope_factor: relative increase of the driving time, per unit of slope across the direction of travel.
        narrow_speed: speed where no room is left around the footprint, m/s.
        full_speed_clearance, backing, collision_penalty, bend: see :class:`pipeline.elevation_map.config.PathCosts`.
        tick: resolution of costs in the search, s.
    """

    half_length: float
    half_width: float
    speed: float
    ramp_speed: float
    speed_near_people: float
    turn_rate: float
    ramp_turn_rate: float
    max_deviation: float
    slope_deviation: float
    slide: float
    lean: float
    cross_slope_factor: float
    full_speed_clearance: float
    narrow_speed: float
    backing: float
    collision_penalty: float
    bend: float
    tick: float


@njit(cache=True)
def distance_to_footprint(x, y, cos, sin, half_length, half_width):
    """Signed distance, m, from points (x, y), m, to the footprint centred on (0, 0) with the heading (cos, sin)."""
    a, b = np.abs(x * cos + y * sin) - half_length, np.abs(y * cos - x * sin) - half_width
    return np.sqrt(np.maximum(a, 0.0) ** 2 + np.maximum(b, 0.0) ** 2) + np.minimum(np.maximum(a, b), 0.0)


@cache
def footprint_distances(half_length, half_width, cell, full_speed_clearance):
    """Cells around the robot, nearest first, and the distance of each cell's centre from the footprint.

    Returns:
        (N, 2) int64 offsets of the cells, (N, 16) int8 distances, cm, by heading and turn as in :class:`Terrain`, and
        (N,) their minima, cm.
    """
    reach = int((np.hypot(half_length, half_width) + full_speed_clearance) / cell) + 1
    offsets = np.argwhere(np.ones((2 * reach + 1,) * 2)) - reach
    x, y = cell * offsets.T[:, :, None, None]
    stands = np.tile(HEADING_ANGLES[:ORIENTATIONS], (6, 1))
    turns = np.linspace(HEADING_ANGLES[:ORIENTATIONS], HEADING_ANGLES[1 : ORIENTATIONS + 1], 6)
    angles = np.hstack([stands, turns])
    room = distance_to_footprint(x, y, np.cos(angles), np.sin(angles), half_length, half_width).min(axis=1)
    distances = np.floor(100 * np.minimum(room, full_speed_clearance)).astype(np.int8)
    least = distances.min(axis=1)
    order = np.argsort(least)[: np.count_nonzero(least < int(100 * full_speed_clearance))]
    return offsets[order], distances[order], least[order]


@njit(cache=True)
def clearances(obstacle, to_obstacle, footprint, near, rows, columns, full_speed_clearance, leniency):
    """(nx, ny, 16) int8 cm, see :class:`Terrain`, for obstacles (nx, ny); everything beyond the grid is unknown.

    ``footprint`` is the result of :func:`footprint_distances` for ``full_speed_clearance``, m. Unknown ground is
    treated as ``leniency`` m farther away. Only cells in the half-open ranges ``rows`` and ``columns`` with an
    obstacle within ``near`` m are computed; the others get ``full_speed_clearance``.
    """
    nx, ny = obstacle.shape
    offsets, distances, nearest = footprint
    result = np.full((nx, ny, HEADINGS), int(100 * full_speed_clearance), np.int8)
    for i in range(rows[0], rows[1]):
        for j in range(columns[0], columns[1]):
            if to_obstacle[i, j] > near:
                continue
            room = result[i, j]
            most = room[0]
            for n in range(len(offsets)):
                if nearest[n] >= most:
                    break
                a, b = i + offsets[n, 0], j + offsets[n, 1]
                kind = obstacle[a, b] if 0 <= a < nx and 0 <= b < ny else UNKNOWN
                if kind == 0:
                    continue
                lenience = int(100 * leniency) if kind == UNKNOWN else 0
                for h in range(HEADINGS):
                    room[h] = min(room[h], distances[n, h] + lenience)
                most = room.max()
    return result


@njit(cache=True)
def allow_for_slopes(clearance, uphill, lean, slide):
    """Clearances (nx, ny, 16), cm, that include room downhill, where the body leans and, in a turn, slides.

    On a gradient ``uphill`` (nx, ny, 2), the body leans by ``lean`` and slides by ``slide`` cells per unit of slope.
    """
    nx, ny = clearance.shape[:2]
    result = clearance.copy()
    for i in range(nx):
        for j in range(ny):
            x, y = uphill[i, j]
            if x == 0 and y == 0:
                continue
            for first, far in ((0, lean), (ORIENTATIONS, lean + slide)):
                a, b = i - round(far * x), j - round(far * y)
                if 0 <= a < nx and 0 <= b < ny:
                    for h in range(first, first + ORIENTATIONS):
                        result[i, j, h] = min(clearance[i, j, h], clearance[a, b, h])
    return result


@njit(cache=True, nogil=True)
def heading_bits(cells, yaws):
    """(K,) uint16 bits, numbered as the entries of a clearance, of the headings nearest to ``yaws`` (K,), rad.

    ``cells`` (K, 2) are the cells of the poses. If a pose is in the same cell as the pose before it and has an
    adjacent heading, the bit of the turn between the two is set, too.
    """
    bits, last = np.zeros(len(cells), np.uint16), -1
    for k in range(len(cells)):
        heading, least = 0, np.inf
        for h in range(ORIENTATIONS):
            off = abs((yaws[k] - HEADING_ANGLES[h] + np.pi / 2) % np.pi - np.pi / 2)
            if off < least:
                heading, least = h, off
        bits[k] = np.uint16(1) << np.uint16(heading)
        is_there = k > 0 and cells[k, 0] == cells[k - 1, 0] and cells[k, 1] == cells[k - 1, 1]
        if is_there and (heading - last) % ORIENTATIONS == 1:
            bits[k] |= np.uint16(1) << np.uint16(ORIENTATIONS + last)
        elif is_there and (last - heading) % ORIENTATIONS == 1:
            bits[k] |= np.uint16(1) << np.uint16(ORIENTATIONS + heading)
        last = heading
    return bits


@njit(cache=True)
def allow_driven(clearance, level, driven, required_clearance, deepest):
    """Raise ``clearance`` (nx, ny, 16), cm, to ``required_clearance`` (nx, ny) at the poses of the bits ``driven``.

    ``driven`` (nx, ny) holds the bits of :func:`heading_bits`. The clearance is not raised where ``level``
    (nx, ny, 16), the clearance of the footprint itself, is below ``deepest``, cm, because drift of the map does not
    move an obstacle so far into the footprint.
    """
    nx, ny, poses = clearance.shape
    for i in range(nx):
        for j in range(ny):
            for h in range(poses if driven[i, j] else 0):
                if driven[i, j] >> h & 1 and level[i, j, h] >= deepest:
                    clearance[i, j, h] = max(clearance[i, j, h], required_clearance[i, j])


@njit(cache=True)
def free_poses(clearance, required_clearance, turn_allowance):
    """(nx, ny, 2) uint8 bits of the eight headings with which the robot can stand, and of the turns that it can make.

    See :class:`Terrain` for ``clearance`` (nx, ny, 16), ``required_clearance`` (nx, ny) and ``turn_allowance``.
    """
    nx, ny = required_clearance.shape
    result = np.zeros((nx, ny, 2), np.uint8)
    for i in range(nx):
        for j in range(ny):
            for h in range(ORIENTATIONS):
                if clearance[i, j, h] >= required_clearance[i, j]:
                    result[i, j, 0] |= 1 << h
                if clearance[i, j, ORIENTATIONS + h] + turn_allowance >= required_clearance[i, j]:
                    result[i, j, 1] |= 1 << h
    return result


@njit(cache=True)
def collision_probability(clearance, spread):
    """Probability that a robot that strays up to ``spread`` m from its path hits an obstacle ``clearance`` m away."""
    return max(0.0, 1.0 - max(clearance, 0.0) / spread) if spread > 0 else 0.0


@njit(cache=True)
def level_speed(room, speed, full_speed_clearance, narrow_speed):
    """Speed on level ground, m/s, which is lower with less ``room``, m (scalar or array), around the footprint."""
    narrow_speed = min(speed, narrow_speed)
    return narrow_speed + (speed - narrow_speed) * np.minimum(np.maximum(room, 0.0) / full_speed_clearance, 1.0)


@njit(cache=True)
def drive_seconds_per_metre(clearance, cos, sin, uphill, is_beside_people, backward, costs):
    """Cost per metre, s, of a drive along (cos, sin) on a slope ``uphill`` (2,), ``clearance`` m from obstacles."""
    across = abs(uphill[1] * cos - uphill[0] * sin)
    on_ramp = uphill[0] != 0 or uphill[1] != 0
    speed = (
        costs.ramp_speed
        if on_ramp
        else level_speed(clearance, costs.speed, costs.full_speed_clearance, costs.narrow_speed)
    )
    if is_beside_people:
        speed = min(speed, costs.speed_near_people)
    seconds = (1.0 + costs.cross_slope_factor * across) / speed
    risk = costs.collision_penalty * collision_probability(clearance, costs.max_deviation)
    return seconds * (costs.backing if backward else 1.0) * (1.0 + risk)


@njit(cache=True)
def turn_seconds_per_radian(clearance, uphill, costs):
    """Cost per radian of a turn in place, s, with ``clearance`` m around the robot on a slope ``uphill`` (2,)."""
    slope = np.hypot(uphill[0], uphill[1])
    seconds = 1.0 / (costs.ramp_turn_rate if slope > 0 else costs.turn_rate)
    deviation = 0.5 * costs.max_deviation + costs.slope_deviation * slope
    return seconds * (1.0 + costs.collision_penalty * collision_probability(clearance, deviation))


@njit(cache=True)
def ticks(seconds, tick):
    """``seconds`` in whole ticks of ``tick`` s, at least one and fewer than ``BUCKETS``."""
    return max(1, min(int(seconds / tick + 0.5), BUCKETS - 1))


@njit(cache=True)
def room_at(x, y, cos, sin, terrain, costs):
    """Distance, m, from the footprint of a robot at (x, y) with the heading (cos, sin) to the nearest obstacle.

    It is at most ``full_speed_clearance``, and -1 off the grid. Unknown ground counts as ``leniency`` farther away.
    """
    nx, ny = terrain.required_clearance.shape
    i, j = cell_at(x, y, terrain.origin, terrain.cell)
    if not (0 <= i < nx and 0 <= j < ny):
        return -1.0
    radius = np.hypot(costs.half_length, costs.half_width) + costs.full_speed_clearance
    if terrain.to_obstacle[i, j] > radius + terrain.cell:
        return costs.full_speed_clearance
    least, reach = costs.full_speed_clearance, int(radius / terrain.cell) + 1
    for a in range(i - reach, i + reach + 1):
        for b in range(j - reach, j + reach + 1):
            kind = terrain.obstacle[a, b] if 0 <= a < nx and 0 <= b < ny else UNKNOWN
            if kind == 0:
                continue
            dx = terrain.origin[0] + (a + 0.5) * terrain.cell - x
            dy = terrain.origin[1] + (b + 0.5) * terrain.cell - y
            d = distance_to_footprint(dx, dy, cos, sin, costs.half_length, costs.half_width)
            least = min(least, d + (terrain.leniency if kind == UNKNOWN else 0.0))
    return least


@njit(cache=True)
def room_on_slope(x, y, cos, sin, uphill, downhill, terrain, costs):
    """Room at a pose, m, see :func:`room_at`; on a slope, the smaller of this and the room farther downhill.

    ``uphill``: (2,) gradient of the slope; ``downhill``: distance to the position downhill, m per unit of slope.
    """
    room = room_at(x, y, cos, sin, terrain, costs)
    if uphill[0] != 0 or uphill[1] != 0:
        below = room_at(x - downhill * uphill[0], y - downhill * uphill[1], cos, sin, terrain, costs)
        room = min(room, below)
    return room


@njit(cache=True)
def pose_clearances(poses, terrain, costs):
    """(N,) m, room around the robot at poses (N, 3) of x and y, m, and heading, rad; negative where it cannot stand.

    On a slope, this includes the room as far downhill as the robot leans.
    """
    nx, ny = terrain.required_clearance.shape
    result = np.empty(len(poses))
    for n in range(len(poses)):
        x, y, heading = poses[n, 0], poses[n, 1], poses[n, 2]
        i, j = cell_at(x, y, terrain.origin, terrain.cell)
        if not (0 <= i < nx and 0 <= j < ny):
            result[n] = -1.0
            continue
        cos, sin = np.cos(heading), np.sin(heading)
        room = room_on_slope(x, y, cos, sin, terrain.uphill[i, j], costs.lean, terrain, costs)
        result[n] = max(room, 0.0) if 100 * room >= terrain.required_clearance[i, j] - 0.5 else -1.0
    return result


@njit(cache=True)
def line_seconds(ax, ay, bx, by, backward, terrain, costs):
    """Cost, s, of a straight drive between two points, m; inf if the footprint meets an obstacle.

    ``backward`` affects only the cost.
    """
    nx, ny = terrain.required_clearance.shape
    dx, dy = bx - ax, by - ay
    length = np.sqrt(dx * dx + dy * dy)
    cos, sin = (dx / length, dy / length) if length > 0 else (1.0, 0.0)
    steps = int(np.ceil(length / terrain.cell)) + 1
    # An obstacle this close to the centre is inside the footprint at any heading; this test finds most blocked lines.
    inside = min(costs.half_length, costs.half_width) - terrain.leniency - terrain.cell
    for s in range(steps + 1):
        i, j = cell_at(ax + dx * s / steps, ay + dy * s / steps, terrain.origin, terrain.cell)
        if (
            not (0 <= i < nx and 0 <= j < ny)
            or terrain.to_obstacle[i, j] < inside + 0.01 * terrain.required_clearance[i, j]
        ):
            return np.inf
    total = 0.0
    for s in range(steps + 1):
        x, y = ax + dx * s / steps, ay + dy * s / steps
        i, j = cell_at(x, y, terrain.origin, terrain.cell)
        room = room_on_slope(x, y, cos, sin, terrain.uphill[i, j], costs.lean, terrain, costs)
        if 100 * room < terrain.required_clearance[i, j] - 0.5:
            return np.inf
        is_beside_people = terrain.beside_people[i, j]
        total += drive_seconds_per_metre(room, cos, sin, terrain.uphill[i, j], is_beside_people, backward, costs)
    return total * length / (steps + 1)


@njit(cache=True)
def lines_seconds(starts, ends, terrain, costs):
    """(N,) s, costs of straight forward drives between points (N, 2), m; see :func:`line_seconds`."""
    result = np.empty(len(starts))
    for n in range(len(starts)):
        result[n] = line_seconds(starts[n, 0], starts[n, 1], ends[n, 0], ends[n, 1], False, terrain, costs)
    return result


@njit(cache=True)
def turn_seconds(x, y, start, end, terrain, costs):
    """Cost, s, of the shorter turn in place between two headings, rad, at (x, y), m; inf if it meets an obstacle.

    On level ground, only the headings in between are checked; :func:`line_seconds` checks the headings at both ends.
    """
    nx, ny = terrain.required_clearance.shape
    i, j = cell_at(x, y, terrain.origin, terrain.cell)
    if not (0 <= i < nx and 0 <= j < ny):
        return np.inf
    angle = (end - start + np.pi) % (2 * np.pi) - np.pi
    room = costs.full_speed_clearance
    uphill, downhill = terrain.uphill[i, j], costs.lean + costs.slide
    steps = int(np.ceil(abs(angle) / 0.2))
    ends = 1 if uphill[0] != 0 or uphill[1] != 0 else 0
    for s in range(1 - ends, steps + ends):
        heading = start + angle * s / steps if steps > 0 else start
        cos, sin = np.cos(heading), np.sin(heading)
        room = min(room, room_on_slope(x, y, cos, sin, uphill, downhill, terrain, costs))
    if 100 * room < terrain.required_clearance[i, j] - 0.5:
        return np.inf
    return abs(angle) * turn_seconds_per_radian(room, terrain.uphill[i, j], costs)
