"""Compiled search over poses: cells of the grid times headings."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.traversability.elevation_kernels import cell_at

_QUADRANT = np.array([(1, 0), (2, 1), (1, 1), (1, 2)])
VECTORS = np.concatenate([_QUADRANT @ np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), k) for k in range(4)])
"""(16, 2) cells that a move along each heading leads on: the headings are those of a lattice, 18 to 27° apart."""
HEADINGS = len(VECTORS)
ANGLES = np.arctan2(VECTORS[:, 1], VECTORS[:, 0]) % (2 * np.pi)
"""(16,) rad."""
UNKNOWN, HAZARD = 1, 2
"""What an obstacle is; 0 is none."""
FARTHEST = 0.2
"""m; more room than this makes no difference."""
LENIENCY = 0.03
"""m by which the robot may come nearer to unknown ground than to a hazard."""
SWEEP = 1
"""cm that a turn to the next heading may come nearer to an obstacle."""
TICK = 0.01
"""s, the unit of costs."""
STOP = 1.5
"""s that a bend of the way takes: slow down, set off again."""
_BUCKETS = 8192
"""Costs of a move are below so many ticks."""
FORWARD, BACKWARD, LEFT, RIGHT = 1, 2, 3, 4
"""Moves."""
_UNDO = np.array([0, BACKWARD, FORWARD, RIGHT, LEFT])


class Terrain(NamedTuple):
    """What a move costs where; layers are (nx, ny) on one grid.

    Attributes:
        origin: (2,) corner of cell [0, 0], m.
        cell: side of a cell, m.
        obstacle: uint8, 0, ``UNKNOWN`` or ``HAZARD``.
        to_obstacle: float64 m to the nearest of them.
        clearance: (nx, ny, 16) int8 cm to the nearest of them, negative inside: from the footprint by its heading, in
            eight entries, and from what it sweeps in a turn from each of these headings to the next.
        least: int8 cm that must be left.
        ramp: bool, the wheels are on a ramp or right before it.
        uphill: (nx, ny, 2) float32, slope of that ramp; 0 where there is none.
    """

    origin: NDArray[np.float64]
    cell: float
    obstacle: NDArray[np.uint8]
    to_obstacle: NDArray[np.float64]
    clearance: NDArray[np.int8]
    least: NDArray[np.int8]
    ramp: NDArray[np.bool_]
    uphill: NDArray[np.float32]


class Costs(NamedTuple):
    """What moves cost a robot.

    Attributes:
        half_length, half_width: of the footprint, m.
        speed, narrow_speed, ramp_speed: m/s, on level ground with much and with little room, and on ramps.
        turn_rate, ramp_turn_rate: rad/s.
        backward: time that a drive backwards counts for, over the same forwards.
        stray: m that the robot may be off its way.
        slide: m more that it may be off after a turn, over the slope.
        across: what driving across a slope adds to the time, over the slope.
        risk: what being sure to meet an obstacle adds to the time, over the time.
    """

    half_length: float
    half_width: float
    speed: float
    narrow_speed: float
    ramp_speed: float
    turn_rate: float
    ramp_turn_rate: float
    backward: float
    stray: float
    slide: float
    across: float
    risk: float


@njit(cache=True)
def distance_to_footprint(x, y, cos, sin, half_length, half_width):
    """Signed distance from a point (x, y) to the rectangle around (0, 0) that heads along (cos, sin)."""
    a, b = abs(x * cos + y * sin) - half_length, abs(y * cos - x * sin) - half_width
    if a <= 0 or b <= 0:
        return max(a, b)
    return np.sqrt(a * a + b * b)


@njit(cache=True)
def footprint_offsets(headings, half_length, half_width, cell):
    """(N, 3) int64: cells around the robot, and the cm from its footprint to their middle, nearest first.

    Of several ``headings`` (K,), rad, the one counts at which the footprint is nearest.
    """
    reach = int((np.hypot(half_length, half_width) + FARTHEST) / cell) + 1
    result = np.empty(((2 * reach + 1) ** 2, 3), np.int64)
    count = 0
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            d = FARTHEST
            for h in headings:
                d = min(d, distance_to_footprint(i * cell, j * cell, np.cos(h), np.sin(h), half_length, half_width))
            if d < FARTHEST:
                result[count, 0], result[count, 1], result[count, 2] = i, j, int(np.floor(100 * d))
                count += 1
    result = result[:count]
    return result[np.argsort(result[:, 2])]


@njit(cache=True)
def clearances(obstacle, to_obstacle, half_length, half_width, cell):
    """(nx, ny, 16) int8, see :class:`Terrain`, for (nx, ny) obstacles; beyond the grid all is unknown."""
    nx, ny = obstacle.shape
    half, most = HEADINGS // 2, int(100 * FARTHEST)
    result = np.full((nx, ny, HEADINGS), most, np.int8)
    near = np.hypot(half_length, half_width) + FARTHEST
    for h in range(HEADINGS):
        swept = np.linspace(ANGLES[h % half], ANGLES[h % half + 1], 6)
        offsets = footprint_offsets(swept if h >= half else swept[:1], half_length, half_width, cell)
        for i in range(nx):
            for j in range(ny):
                if to_obstacle[i, j] > near:
                    continue
                least = most
                for n in range(len(offsets)):
                    d = offsets[n, 2]
                    if d >= least:
                        break
                    a, b = i + offsets[n, 0], j + offsets[n, 1]
                    kind = obstacle[a, b] if 0 <= a < nx and 0 <= b < ny else UNKNOWN
                    if kind == HAZARD:
                        least = d
                    elif kind == UNKNOWN:
                        least = min(least, d + int(100 * LENIENCY))
                result[i, j, h] = least
    return result


@njit(cache=True)
def danger(clearance, spread):
    """How likely the robot meets something ``clearance`` m away if it may be off by ``spread`` m."""
    return max(0.0, 1.0 - max(clearance, 0.0) / spread)


@njit(cache=True)
def drive_seconds_per_metre(clearance, cos, sin, uphill, backward, costs):
    """What a metre along (cos, sin) costs, s, with ``clearance`` m beside the footprint on a slope (2,)."""
    across = abs(uphill[1] * cos - uphill[0] * sin)
    on_ramp = uphill[0] != 0 or uphill[1] != 0
    level_speed = costs.speed if clearance >= FARTHEST - 0.01 else costs.narrow_speed
    seconds = (1.0 + costs.across * across) / (costs.ramp_speed if on_ramp else level_speed)
    return seconds * (costs.backward if backward else 1.0) * (1.0 + costs.risk * danger(clearance, costs.stray))


@njit(cache=True)
def turn_seconds_per_radian(clearance, uphill, costs):
    """What a radian on the spot costs, s, with ``clearance`` m around the footprint on a slope (2,)."""
    slope = np.hypot(uphill[0], uphill[1])
    seconds = 1.0 / (costs.ramp_turn_rate if slope > 0 else costs.turn_rate)
    return seconds * (1.0 + costs.risk * danger(clearance, 0.5 * costs.stray + costs.slide * slope))


@njit(cache=True)
def ticks(seconds):
    """Whole ticks, at least one and less than the buckets hold."""
    return max(1, min(int(seconds / TICK + 0.5), _BUCKETS - 1))


@njit(cache=True, inline="always")
def move_from(i, j, h, move):
    """The state that a move leads to from (i, j, h)."""
    if move == FORWARD:
        return i + VECTORS[h, 0], j + VECTORS[h, 1], h
    if move == BACKWARD:
        return i - VECTORS[h, 0], j - VECTORS[h, 1], h
    return i, j, (h + (1 if move == LEFT else -1)) % HEADINGS


@njit(cache=True)
def move_ticks(h, move, room, uphill, cell, costs):
    """Ticks of a move from a heading, with ``room`` cm around the footprint on a slope (2,)."""
    if move <= BACKWARD:
        length = cell * np.hypot(VECTORS[h, 0], VECTORS[h, 1])
        cos, sin = np.cos(ANGLES[h]), np.sin(ANGLES[h])
        return ticks(length * drive_seconds_per_metre(0.01 * room, cos, sin, uphill, move == BACKWARD, costs))
    angle = abs((ANGLES[h] - ANGLES[move_from(0, 0, h, move)[2]] + np.pi) % (2 * np.pi) - np.pi)
    return ticks(angle * turn_seconds_per_radian(0.01 * room, uphill, costs))


@njit(cache=True)
def level_ticks(cell, costs):
    """(5, 16, R) int32 ticks of each move from each heading on level ground, by the cm of room."""
    level = np.zeros(2, np.float32)
    result = np.zeros((RIGHT + 1, HEADINGS, int(100 * FARTHEST) + 1), np.int32)
    for move in range(FORWARD, RIGHT + 1):
        for h in range(HEADINGS):
            for room in range(result.shape[2]):
                result[move, h, room] = move_ticks(h, move, room, level, cell, costs)
    return result


@njit(cache=True, inline="always")
def entry_ticks(i, j, h, a, b, k, move, start, terrain, level, costs, escape, escape_factor):
    """Ticks of a move from (i, j, h) to (a, b, k) on a way from a start (2,); -1 where it is not allowed."""
    half = HEADINGS // 2
    before, entered = terrain.clearance[i, j, h % half], terrain.clearance[a, b, k % half]
    if move <= BACKWARD:
        room = min(before, entered)
    else:
        room = terrain.clearance[i, j, half + (h if move == LEFT else k) % half]
        # A tight turn is one of little room as well, and so is a way out.
        entered = min(entered, room + SWEEP)
    is_free = entered >= terrain.least[a, b]
    if not is_free and (entered < before or max(abs(a - start[0]), abs(b - start[1])) > escape):
        return -1
    if terrain.ramp[a, b]:
        step = move_ticks(h, move, room, terrain.uphill[a, b], terrain.cell, costs)
    else:
        step = level[move, h, max(room, 0)]
    return step if is_free else min(int(escape_factor * step), _BUCKETS - 1)


class Queue(NamedTuple):
    """Entries in buckets by their cost; a state that has become cheaper leaves its old entry behind.

    Attributes:
        first: (B,) int32 the first entry of each bucket; -1 where there is none.
        state: (E,) int32 of each entry.
        after: (E,) int32 the next entry of its bucket, or of those that are not in use.
        count: (3,) int64 the entries that wait, those that were ever in use, and the first that is not now, or -1.
    """

    first: NDArray[np.int32]
    state: NDArray[np.int32]
    after: NDArray[np.int32]
    count: NDArray[np.int64]


@njit(cache=True, inline="always")
def put(state, cost, queue):
    """Let a state wait in the bucket of a cost."""
    entry = queue.count[2]
    if entry >= 0:
        queue.count[2] = queue.after[entry]
    else:
        entry = queue.count[1]
        queue.count[1] += 1
    queue.state[entry], queue.after[entry] = state, queue.first[cost % _BUCKETS]
    queue.first[cost % _BUCKETS] = entry
    queue.count[0] += 1


@njit(cache=True, inline="always")
def take(cost, queue):
    """A state from the bucket of a cost, which is not empty."""
    entry = queue.first[cost % _BUCKETS]
    queue.first[cost % _BUCKETS] = queue.after[entry]
    queue.after[entry], queue.count[2] = queue.count[2], entry
    queue.count[0] -= 1
    return queue.state[entry]


@njit(cache=True)
def search(starts, terrain, costs, escape, escape_factor):
    """Dijkstra's algorithm over all poses, with buckets for a queue.

    A pose may be entered where enough room is left. A robot that stands where it is not may go, up to ``escape``
    cells from its start and at ``escape_factor`` of the cost, from pose to pose where it is never less.

    Args:
        starts: (K, 3) int64 cells and headings.
        terrain: what a move costs where.
        costs: of the robot.
        escape: cells.
        escape_factor: at least 1.

    Returns:
        (nx, ny, 16) int32 ticks and one more, 0 where no way leads, (nx, ny, 16) uint8 the move that led there, and
        (nx, ny, 16) int16 from which start.
    """
    nx, ny = terrain.least.shape
    shape, size = (nx, ny, HEADINGS), nx * ny * HEADINGS
    # Pages of memory that no way reaches are never touched.
    cost, came_by, source = np.zeros(size, np.int32), np.zeros(size, np.uint8), np.zeros(size, np.int16)
    most = 4 * size + len(starts)
    queue = Queue(
        np.full(_BUCKETS, -1, np.int32), np.empty(most, np.int32), np.empty(most, np.int32), np.zeros(3, np.int64)
    )
    queue.count[2] = -1
    level, now = level_ticks(terrain.cell, costs), 1
    for n in range(len(starts)):
        state = (starts[n, 0] * ny + starts[n, 1]) * HEADINGS + starts[n, 2]
        if cost[state] == 0:
            cost[state], source[state] = now, n
            put(state, now, queue)
    while queue.count[0] > 0:
        if queue.first[now % _BUCKETS] < 0:
            now += 1
            continue
        state = take(now, queue)
        if cost[state] != now:
            continue
        i, j, h = state // HEADINGS // ny, state // HEADINGS % ny, state % HEADINGS
        start = (starts[source[state], 0], starts[source[state], 1])
        for move in range(FORWARD, RIGHT + 1):
            a, b, k = move_from(i, j, h, move)
            if not (0 <= a < nx and 0 <= b < ny):
                continue
            step = entry_ticks(i, j, h, a, b, k, move, start, terrain, level, costs, escape, escape_factor)
            then, new = (a * ny + b) * HEADINGS + k, now + step
            if step > 0 and (cost[then] == 0 or cost[then] > new):
                cost[then], came_by[then], source[then] = new, move, source[state]
                put(then, new, queue)
    return cost.reshape(shape), came_by.reshape(shape), source.reshape(shape)


@njit(cache=True)
def room_at(x, y, cos, sin, terrain, costs):
    """m from the footprint of a robot at (x, y) m that heads along (cos, sin) to the nearest obstacle."""
    nx, ny = terrain.least.shape
    i, j = cell_at(x, y, terrain.origin, terrain.cell)
    if not (0 <= i < nx and 0 <= j < ny):
        return -1.0
    radius = np.hypot(costs.half_length, costs.half_width) + costs.stray + LENIENCY
    if terrain.to_obstacle[i, j] > radius + terrain.cell:
        return FARTHEST
    least, reach = FARTHEST, int(radius / terrain.cell) + 1
    for a in range(i - reach, i + reach + 1):
        for b in range(j - reach, j + reach + 1):
            kind = terrain.obstacle[a, b] if 0 <= a < nx and 0 <= b < ny else UNKNOWN
            if kind == 0:
                continue
            dx = terrain.origin[0] + (a + 0.5) * terrain.cell - x
            dy = terrain.origin[1] + (b + 0.5) * terrain.cell - y
            d = distance_to_footprint(dx, dy, cos, sin, costs.half_length, costs.half_width)
            least = min(least, d + (LENIENCY if kind == UNKNOWN else 0.0))
    return least


@njit(cache=True)
def line_seconds(ax, ay, bx, by, backward, terrain, costs):
    """What a straight drive between points, m, costs, s; inf where the footprint meets something.

    ``backward`` only changes what it costs.
    """
    nx, ny = terrain.least.shape
    dx, dy = bx - ax, by - ay
    length = np.sqrt(dx * dx + dy * dy)
    cos, sin = (dx / length, dy / length) if length > 0 else (1.0, 0.0)
    steps = int(np.ceil(length / terrain.cell)) + 1
    total = 0.0
    for s in range(steps + 1):
        x, y = ax + dx * s / steps, ay + dy * s / steps
        i, j = cell_at(x, y, terrain.origin, terrain.cell)
        if not (0 <= i < nx and 0 <= j < ny):
            return np.inf
        room = room_at(x, y, cos, sin, terrain, costs)
        if 100 * room < terrain.least[i, j] - 0.5:
            return np.inf
        total += drive_seconds_per_metre(room, cos, sin, terrain.uphill[i, j], backward, costs)
    return total * length / (steps + 1)


@njit(cache=True)
def lines_seconds(starts, ends, terrain, costs):
    """(N,) :func:`line_seconds` forwards between points (N, 2), m."""
    result = np.empty(len(starts))
    for n in range(len(starts)):
        result[n] = line_seconds(starts[n, 0], starts[n, 1], ends[n, 0], ends[n, 1], False, terrain, costs)
    return result


@njit(cache=True)
def turn_seconds(x, y, start, end, terrain, costs):
    """What a turn on the spot the shorter way between two headings, rad, at (x, y) m costs, s; inf if impossible.

    Nothing may be met at the headings in between either; at both ends :func:`line_seconds` tells.
    """
    nx, ny = terrain.least.shape
    i, j = cell_at(x, y, terrain.origin, terrain.cell)
    if not (0 <= i < nx and 0 <= j < ny):
        return np.inf
    angle = (end - start + np.pi) % (2 * np.pi) - np.pi
    room = FARTHEST
    steps = int(np.ceil(abs(angle) / 0.2))
    for s in range(1, steps):
        heading = start + angle * s / steps
        room = min(room, room_at(x, y, np.cos(heading), np.sin(heading), terrain, costs))
    if 100 * room < terrain.least[i, j] - 0.5:
        return np.inf
    return abs(angle) * turn_seconds_per_radian(room, terrain.uphill[i, j], costs)


@njit(cache=True)
def trace(came_by, i, j, h):
    """(N, 3) int64 poses (i, j, h) from the last one back to the start."""
    count, (a, b, k) = 1, (i, j, h)
    while came_by[a, b, k] > 0:
        a, b, k = move_from(a, b, k, _UNDO[came_by[a, b, k]])
        count += 1
    result = np.empty((count, 3), np.int64)
    for n in range(count):
        result[n, 0], result[n, 1], result[n, 2] = i, j, h
        if n < count - 1:
            i, j, h = move_from(i, j, h, _UNDO[came_by[i, j, h]])
    return result


@njit(cache=True)
def gear(moves, p, q):
    """``FORWARD`` or ``BACKWARD`` if ``moves`` (N,) lead so from pose p to q of a way, 0 if it only turns there."""
    for n in range(p + 1, q + 1):
        if moves[n] == FORWARD or moves[n] == BACKWARD:
            return moves[n]
    return 0


@njit(cache=True)
def drive_end(moves, p, forward):
    """The last pose of a way to which ``moves`` (N,) lead from pose p in no other gear than ``forward``."""
    end = p
    for n in range(p + 1, len(moves)):
        if moves[n] == forward:
            end = n
        elif moves[n] <= BACKWARD:
            break
    return end


@njit(cache=True)
def straight_end(moves, p):
    """The pose up to which ``moves`` (N,) of a way lead straight on from pose p, after turns there."""
    n = p + 1
    while moves[n] > BACKWARD:
        n += 1
    while n + 1 < len(moves) and moves[n + 1] == moves[n]:
        n += 1
    return n


@njit(cache=True)
def straighten(places, headings, moves, seconds, heading, terrain, costs):
    """Indices of the bends of a way, first and last pose included, between which straight drives lead.

    A straight drive takes the place of a stretch of the way if it costs no more, the turns at its ends included.

    Args:
        places: (N, 2) m.
        headings: (N,) rad.
        moves: (N,) uint8 that led to each.
        seconds: (N,) float64 that the way to each costs.
        heading: rad at the first one.
    """
    bends, p = [0], 0
    while gear(moves, p, len(places) - 1) > 0:
        forward = gear(moves, p, len(places) - 1)
        q = straight_end(moves, p)
        ahead, (x, y) = headings[q], places[p]
        for r in range(drive_end(moves, p, forward), q, -1):
            u, v = places[r]
            bearing = np.arctan2(v - y, u - x) + (np.pi if forward == BACKWARD else 0.0)
            due = seconds[r] - seconds[p] + STOP
            cost = turn_seconds(x, y, heading, bearing, terrain, costs)
            if cost <= due:
                cost += turn_seconds(u, v, bearing, headings[r], terrain, costs)
            if cost <= due:
                cost += line_seconds(x, y, u, v, forward == BACKWARD, terrain, costs)
            if cost <= due:
                q, ahead = r, bearing
                break
        bends.append(q)
        p, heading = q, ahead
    return np.array(bends)
