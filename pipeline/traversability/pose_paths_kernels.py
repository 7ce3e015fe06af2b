"""Compiled search over poses: cells of the grid times headings."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.traversability.pose_kernels import (
    ANGLES,
    BUCKETS,
    FARTHEST,
    HEADINGS,
    STOP,
    SWEEP,
    VECTORS,
    drive_seconds_per_metre,
    line_seconds,
    ticks,
    turn_seconds,
    turn_seconds_per_radian,
)

FORWARD, BACKWARD, LEFT, RIGHT = 1, 2, 3, 4
"""Moves."""
ESCAPE_FACTOR = 5.0
"""Factor of the cost of moves through poses without room."""
_UNDO = np.array([0, BACKWARD, FORWARD, RIGHT, LEFT])


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
    """Cost in ticks of a move from a heading, with ``room`` cm around the footprint on a slope ``uphill`` (2,)."""
    if move <= BACKWARD:
        length = cell * np.hypot(VECTORS[h, 0], VECTORS[h, 1])
        cos, sin = np.cos(ANGLES[h]), np.sin(ANGLES[h])
        return ticks(length * drive_seconds_per_metre(0.01 * room, cos, sin, uphill, move == BACKWARD, costs))
    angle = abs((ANGLES[h] - ANGLES[move_from(0, 0, h, move)[2]] + np.pi) % (2 * np.pi) - np.pi)
    return ticks(angle * turn_seconds_per_radian(0.01 * room, uphill, costs))


@njit(cache=True)
def level_ticks(cell, costs):
    """(5, 16, R) int32 cost in ticks of each move from each heading on level ground, by the cm of room."""
    level = np.zeros(2, np.float32)
    result = np.zeros((RIGHT + 1, HEADINGS, int(100 * FARTHEST) + 1), np.int32)
    for move in range(FORWARD, RIGHT + 1):
        for h in range(HEADINGS):
            for room in range(result.shape[2]):
                result[move, h, room] = move_ticks(h, move, room, level, cell, costs)
    return result


@njit(cache=True)
def was_near(i, j, least):
    """Whether the robot's middle has been in a cell or next to it: there ``least`` (nx, ny), cm, is negative."""
    for a in range(max(i - 1, 0), min(i + 2, least.shape[0])):
        for b in range(max(j - 1, 0), min(j + 2, least.shape[1])):
            if least[a, b] < 0:
                return True
    return False


@njit(cache=True, inline="always")
def entry_ticks(i, j, h, a, b, k, move, start, terrain, level, costs, escape):
    """Cost in ticks of a move from (i, j, h) to (a, b, k) on a way from a start (2,); -1 if it is not allowed."""
    half = HEADINGS // 2
    before, entered = terrain.clearance[i, j, h % half], terrain.clearance[a, b, k % half]
    if move <= BACKWARD:
        room = min(before, entered)
    else:
        room = terrain.clearance[i, j, half + (h if move == LEFT else k) % half]
        # What the turn sweeps must have room as well.
        entered = min(entered, room + SWEEP)
    is_free = entered >= terrain.least[a, b]
    if not is_free and max(abs(a - start[0]), abs(b - start[1])) > escape:
        return -1
    if not is_free and entered < before and not was_near(a, b, terrain.least):
        return -1
    if terrain.ramp[a, b]:
        step = move_ticks(h, move, room, terrain.uphill[a, b], terrain.cell, costs)
    else:
        step = level[move, h, max(room, 0)]
    return step if is_free else min(int(ESCAPE_FACTOR * step), BUCKETS - 1)


class Search(NamedTuple):
    """The state of a search; poses are numbered (i · ny + j) · 16 + h.

    Attributes:
        starts: (K, 3) int64 cells and headings.
        cost: (N,) int32 1 + ticks; 0 where no way has been found yet.
        came_by: (N,) uint8 the move that led to each pose.
        source: (N,) int16 index of the start from which the way comes.
        level: (5, 16, R) ticks of moves on level ground, see :func:`level_ticks`.
        escape: m from its start within which a robot may drive through poses without room, as long as the clearance
            does not shrink, or where the robot has been.
        now: (1,) int64 the cost up to which all poses are settled.
    """

    starts: NDArray[np.int64]
    cost: NDArray[np.int32]
    came_by: NDArray[np.uint8]
    source: NDArray[np.int16]
    level: NDArray[np.int32]
    escape: float
    now: NDArray[np.int64]


class Queue(NamedTuple):
    """Entries in buckets by their cost; a state that has become cheaper leaves its old entry behind.

    Attributes:
        first: (B,) int32 the first entry of each bucket; -1 where there is none.
        state: (E,) int32 of each entry.
        after: (E,) int32 the next entry of the same bucket, or of the list of free entries.
        used: (3,) int64 number of waiting entries, number of entries ever used, and the first free entry or -1.
    """

    first: NDArray[np.int32]
    state: NDArray[np.int32]
    after: NDArray[np.int32]
    used: NDArray[np.int64]


@njit(cache=True, inline="always")
def put(state, cost, queue):
    """Put a state into the bucket of a cost."""
    entry = queue.used[2]
    if entry >= 0:
        queue.used[2] = queue.after[entry]
    else:
        entry = queue.used[1]
        queue.used[1] += 1
    queue.state[entry], queue.after[entry] = state, queue.first[cost % BUCKETS]
    queue.first[cost % BUCKETS] = entry
    queue.used[0] += 1


@njit(cache=True, inline="always")
def take(cost, queue):
    """Remove a state from the bucket of a cost, which is not empty, and return it."""
    entry = queue.first[cost % BUCKETS]
    queue.first[cost % BUCKETS] = queue.after[entry]
    queue.after[entry], queue.used[2] = queue.used[2], entry
    queue.used[0] -= 1
    return queue.state[entry]


@njit(cache=True)
def begin(search, queue, ny):
    """Put the starts into an empty queue, on a grid that is ``ny`` cells wide."""
    queue.first[:] = -1
    queue.used[:] = 0, 0, -1
    search.now[0] = 1
    for n in range(len(search.starts)):
        i, j, h = search.starts[n]
        state = (i * ny + j) * HEADINGS + h
        if search.cost[state] == 0:
            search.cost[state], search.source[state] = 1, n
            put(state, 1, queue)


@njit(cache=True)
def extend(search, queue, terrain, costs, until):
    """Continue Dijkstra's algorithm over all poses up to the cost ``until``, with a bucket queue.

    A pose may be entered if its clearance is large enough. A robot that starts with less may escape, see
    :class:`Search`.

    Returns:
        True if the search has reached ``until`` or its end; False if the queue is full: call again with a larger one.
    """
    nx, ny = terrain.least.shape
    cost, source, level, now = search.cost, search.source, search.level, search.now[0]
    escape = int(search.escape / terrain.cell)
    while queue.used[0] > 0 and now <= until:
        search.now[0] = now
        if queue.used[1] + RIGHT > len(queue.state):
            return False
        if queue.first[now % BUCKETS] < 0:
            now += 1
            continue
        state = take(now, queue)
        if cost[state] != now:
            continue
        i, j, h = state // HEADINGS // ny, state // HEADINGS % ny, state % HEADINGS
        start = (search.starts[source[state], 0], search.starts[source[state], 1])
        for move in range(FORWARD, RIGHT + 1):
            a, b, k = move_from(i, j, h, move)
            if not (0 <= a < nx and 0 <= b < ny):
                continue
            step = entry_ticks(i, j, h, a, b, k, move, start, terrain, level, costs, escape)
            then, new = (a * ny + b) * HEADINGS + k, now + step
            if step > 0 and (cost[then] == 0 or cost[then] > new):
                cost[then], search.came_by[then], source[then] = new, move, source[state]
                put(then, new, queue)
    search.now[0] = now
    return True


@njit(cache=True)
def flood(seeds, free):
    """Which poses are connected to the seeds by moves through poses with enough room.

    Args:
        seeds: (nx, ny) uint16 bits of the 16 headings to start with.
        free: (nx, ny, 2) uint8, see ``free_poses``.

    Returns:
        (nx, ny) uint16 bits of the headings that are reached, seeds included.
    """
    nx, ny = seeds.shape
    reached, new = np.zeros((nx, ny), np.uint16), seeds.copy()
    # A cell is at most once among the waiting ones.
    waiting, count = np.empty(nx * ny, np.int32), 0
    for cell in range(nx * ny):
        if seeds[cell // ny, cell % ny]:
            waiting[count] = cell
            count += 1
    while count > 0:
        count -= 1
        i, j = waiting[count] // ny, waiting[count] % ny
        # Opposite headings have the same footprint.
        stands, turns = 257 * np.int64(free[i, j, 0]), 257 * np.int64(free[i, j, 1])
        known = np.int64(reached[i, j])
        here, before = known | np.int64(new[i, j]), np.int64(0)
        new[i, j] = 0
        while here != before:
            before = here
            left = here & turns
            here |= ((left << 1) | (left >> 15)) & stands
            here |= ((here >> 1) | (here << 15)) & turns & stands
        fresh = here & ~known
        reached[i, j] = here
        for h in range(HEADINGS // 2):
            # A robot with the opposite heading drives backwards to the same cell.
            both = fresh & (257 << h)
            if both == 0:
                continue
            for sign in (1, -1):
                a, b = i + sign * VECTORS[h, 0], j + sign * VECTORS[h, 1]
                if not (0 <= a < nx and 0 <= b < ny) or not (free[a, b, 0] >> h) & 1:
                    continue
                more = both & ~np.int64(reached[a, b] | new[a, b])
                if more != 0:
                    if new[a, b] == 0:
                        waiting[count] = a * ny + b
                        count += 1
                    new[a, b] |= np.uint16(more)
    return reached


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
    """``FORWARD`` or ``BACKWARD``, the first drive among ``moves`` (N,) from pose p to q; 0 if all are turns."""
    for n in range(p + 1, q + 1):
        if moves[n] == FORWARD or moves[n] == BACKWARD:
            return moves[n]
    return 0


@njit(cache=True)
def drive_end(moves, p, forward):
    """The last pose of a way to which ``moves`` (N,) lead from pose p with no drive other than ``forward``."""
    end = p
    for n in range(p + 1, len(moves)):
        if moves[n] == forward:
            end = n
        elif moves[n] <= BACKWARD:
            break
    return end


@njit(cache=True)
def straight_end(moves, p):
    """The last pose to which ``moves`` (N,) of a way lead straight on from pose p, after turns in place at p."""
    n = p + 1
    while moves[n] > BACKWARD:
        n += 1
    while n + 1 < len(moves) and moves[n + 1] == moves[n]:
        n += 1
    return n


@njit(cache=True)
def straighten(places, headings, moves, seconds, heading, terrain, costs):
    """Indices of the bends of a way, first and last pose included, between which straight drives lead.

    A straight drive replaces a stretch of the way if it costs at most ``STOP`` s more, turns at both ends included.

    Args:
        places: (N, 2) m.
        headings: (N,) rad.
        moves: (N,) uint8, the move that led to each pose.
        seconds: (N,) float64, cost of the way to each pose.
        heading: rad at the first pose.
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
