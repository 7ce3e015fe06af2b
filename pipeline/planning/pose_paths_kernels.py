"""Compiled search over poses, each of which consists of a cell of the grid and a heading."""

from enum import IntEnum, auto
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.elevation_map.pose_kernels import (
    BUCKETS,
    HEADING_ANGLES,
    HEADINGS,
    ORIENTATIONS,
    VECTORS,
    drive_seconds_per_metre,
    line_seconds,
    ticks,
    turn_seconds,
    turn_seconds_per_radian,
)

ALL_HEADINGS = np.iinfo(np.uint16).max
"""Bits of all headings."""


class Move(IntEnum):
    """A drive along the heading, or a turn to the next heading; 0 stands for no move."""

    FORWARD = auto()
    BACKWARD = auto()
    LEFT = auto()
    RIGHT = auto()


_INVERSE_MOVES = np.array([Move.BACKWARD, Move.FORWARD, Move.RIGHT, Move.LEFT])


@njit(cache=True, inline="always")
def move_from(i, j, h, move):
    """The cell and heading (i, j, h) to which a move from (i, j, h) leads."""
    if move == Move.FORWARD:
        return i + VECTORS[h, 0], j + VECTORS[h, 1], h
    if move == Move.BACKWARD:
        return i - VECTORS[h, 0], j - VECTORS[h, 1], h
    return i, j, (h + (1 if move == Move.LEFT else -1)) % HEADINGS


@njit(cache=True)
def move_ticks(h, move, room, uphill, is_beside_people, cell, costs):
    """Cost in ticks of a move from heading ``h`` with ``room`` cm around the robot on a slope ``uphill`` (2,)."""
    if move <= Move.BACKWARD:
        length = cell * np.hypot(VECTORS[h, 0], VECTORS[h, 1])
        cos, sin = np.cos(HEADING_ANGLES[h]), np.sin(HEADING_ANGLES[h])
        is_backward = move == Move.BACKWARD
        per_metre = drive_seconds_per_metre(0.01 * room, cos, sin, uphill, is_beside_people, is_backward, costs)
        return ticks(length * per_metre, costs.tick)
    angle = abs((HEADING_ANGLES[h] - HEADING_ANGLES[move_from(0, 0, h, move)[2]] + np.pi) % (2 * np.pi) - np.pi)
    return ticks(angle * turn_seconds_per_radian(0.01 * room, uphill, costs), costs.tick)


@njit(cache=True)
def level_ticks(cell, costs):
    """(5, 16, R) int32 cost in ticks of each move from each heading on level ground, by the room in whole cm.

    No people are near.
    """
    level = np.zeros(2, np.float32)
    result = np.zeros((Move.RIGHT + 1, HEADINGS, int(100 * costs.full_speed_clearance) + 1), np.int32)
    for move in range(Move.FORWARD, Move.RIGHT + 1):
        for h in range(HEADINGS):
            for room in range(result.shape[2]):
                result[move, h, room] = move_ticks(h, move, room, level, False, cell, costs)
    return result


@njit(cache=True)
def was_near(i, j, required_clearance):
    """Whether the robot's centre has been in cell (i, j) or in a neighbour.

    ``required_clearance``: (nx, ny) cm, negative in the cells where the robot's centre has been.
    """
    for a in range(max(i - 1, 0), min(i + 2, required_clearance.shape[0])):
        for b in range(max(j - 1, 0), min(j + 2, required_clearance.shape[1])):
            if required_clearance[a, b] < 0:
                return True
    return False


@njit(cache=True, inline="always")
def entry_ticks(i, j, h, a, b, k, move, start, terrain, level, costs, escape):
    """Cost in ticks of a move from (i, j, h) to (a, b, k) on a path from a start cell (2,); -1 if it is not allowed.

    ``level``: the costs of :func:`level_ticks`; ``escape``: :attr:`Search.escape_distance` in cells.
    """
    before, entered = (terrain.clearance[i, j, h % ORIENTATIONS], terrain.clearance[a, b, k % ORIENTATIONS])
    if move <= Move.BACKWARD:
        room = min(before, entered)
    else:
        room = terrain.clearance[i, j, ORIENTATIONS + (h if move == Move.LEFT else k) % ORIENTATIONS]
        # The area that the turn sweeps must have room as well.
        entered = min(entered, room + terrain.turn_allowance)
    is_free = entered >= terrain.required_clearance[a, b]
    if not is_free and max(abs(a - start[0]), abs(b - start[1])) > escape:
        return -1
    # A turn may sweep cells that the robot has never swept, even if the robot has been at the same position.
    if not is_free and entered < before and (move > Move.BACKWARD or not was_near(a, b, terrain.required_clearance)):
        return -1
    is_beside_people = terrain.beside_people[a, b]
    if terrain.ramp[a, b] or is_beside_people:
        return move_ticks(h, move, room, terrain.uphill[a, b], is_beside_people, terrain.cell, costs)
    return level[move, h, max(room, 0)]


class Search(NamedTuple):
    """The state of a search; the index of a pose is (i · ny + j) · 16 + h.

    The queue is divided into buckets by cost. It gets an entry whenever a pose becomes cheaper, at most one for each
    move that leads to the pose.

    Attributes:
        starts: (K, 3) int64 cells and headings at which the search starts.
        cost: (N,) int32, 1 + cost of each pose in ticks; 0 where no path has been found yet.
        came_by: (N,) uint8 move that led to each pose.
        source: (N,) int16 index of the start from which the path to each pose comes.
        level_costs: (5, 16, R) int32 costs of moves on level ground in ticks, see :func:`level_ticks`.
        escape_distance: distance from the start within which the robot may drive through poses without enough room,
            m; negative if all starts have enough room. The robot may do so only where it has been before, or where
            its clearance does not decrease.
        first: (B,) int32 first entry of each bucket; -1 for an empty bucket.
        state, after: (4 N + K,) int32 pose of each entry, and next entry in the same bucket.
        progress: (3,) int64: the value of ``cost`` up to which all poses are settled, the number of waiting entries,
            and the number of all entries so far.
    """

    starts: NDArray[np.int64]
    cost: NDArray[np.int32]
    came_by: NDArray[np.uint8]
    source: NDArray[np.int16]
    level_costs: NDArray[np.int32]
    escape_distance: float
    first: NDArray[np.int32]
    state: NDArray[np.int32]
    after: NDArray[np.int32]
    progress: NDArray[np.int64]


@njit(cache=True)
def extend(search, terrain, costs, until):
    """Continue Dijkstra's algorithm over all poses, with a bucket queue, up to the value ``until`` of ``cost``.

    The robot may enter a pose with enough clearance. A robot that starts with too little clearance may escape; see
    :class:`Search`.
    """
    nx, ny = terrain.required_clearance.shape
    cost, source, level, first = search.cost, search.source, search.level_costs, search.first
    escape, (now, waiting, used) = int(search.escape_distance / terrain.cell), search.progress
    while waiting > 0 and now <= until:
        entry = first[now % BUCKETS]
        if entry < 0:
            now += 1
            continue
        first[now % BUCKETS] = search.after[entry]
        waiting -= 1
        state = search.state[entry]
        if cost[state] != now:
            continue
        i, j, h = state // HEADINGS // ny, state // HEADINGS % ny, state % HEADINGS
        start = (search.starts[source[state], 0], search.starts[source[state], 1])
        for move in range(Move.FORWARD, Move.RIGHT + 1):
            a, b, k = move_from(i, j, h, move)
            then = (a * ny + b) * HEADINGS + k
            # Poses that are already settled, such as the previous pose, do not become cheaper.
            if not (0 <= a < nx and 0 <= b < ny) or 0 < cost[then] <= now:
                continue
            step = entry_ticks(i, j, h, a, b, k, move, start, terrain, level, costs, escape)
            new = now + step
            if step > 0 and (cost[then] == 0 or cost[then] > new):
                cost[then], search.came_by[then], source[then] = new, move, source[state]
                search.state[used], search.after[used] = then, first[new % BUCKETS]
                first[new % BUCKETS] = used
                waiting, used = waiting + 1, used + 1
    search.progress[:] = now, waiting, used


@njit(cache=True)
def flood(seeds, free, is_open):
    """The poses that are connected to the seeds by moves through poses with enough room.

    Args:
        seeds: (nx, ny) uint16 bits of the 16 headings to start with.
        free: (nx, ny, 2) uint8, see :func:`pipeline.elevation_map.pose_kernels.free_poses`.
        is_open: (nx, ny) whether the robot can stand and turn with any heading in all cells within two cells of each
            cell.

    Returns:
        (nx, ny) uint16 bits of the headings that are reached, including the seeds.
    """
    nx, ny = seeds.shape
    reached, new = np.zeros((nx, ny), np.uint16), seeds.copy()
    # Each cell is at most once in the list of waiting cells.
    rows, columns = np.nonzero(seeds)
    waiting, count = np.empty((nx * ny, 2), np.int32), len(rows)
    waiting[:count, 0], waiting[:count, 1] = rows, columns
    while count > 0:
        count -= 1
        i, j = np.int64(waiting[count, 0]), np.int64(waiting[count, 1])
        # Opposite headings have the same footprint.
        stands, turns = 257 * np.int64(free[i, j, 0]), 257 * np.int64(free[i, j, 1])
        known = np.int64(reached[i, j])
        here, before = np.int64(ALL_HEADINGS) if is_open[i, j] else known | np.int64(new[i, j]), np.int64(0)
        new[i, j] = 0
        while here != before and not is_open[i, j]:
            before = here
            left = here & turns
            here |= ((left << 1) | (left >> 15)) & stands
            here |= ((here >> 1) | (here << 15)) & turns & stands
        fresh = here & ~known
        reached[i, j] = here
        # On open ground, moves along the axes reach everything that the other moves reach.
        for h in range(0, ORIENTATIONS, HEADINGS // 4 if is_open[i, j] else 1):
            # A robot with the opposite heading reaches the same cell backwards.
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
                        waiting[count, 0], waiting[count, 1] = a, b
                        count += 1
                    new[a, b] |= np.uint16(more)
    return reached


@njit(cache=True)
def trace(came_by, i, j, h):
    """(N, 3) int64 poses from the pose (i, j, h) back to the start."""
    poses = [(i, j, h)]
    while came_by[i, j, h] > 0:
        i, j, h = move_from(i, j, h, _INVERSE_MOVES[came_by[i, j, h] - 1])
        poses.append((i, j, h))
    return np.array(poses)


@njit(cache=True)
def straighten(places, headings, moves, seconds, heading, terrain, costs):
    """Replace parts of a path by straight drives.

    A straight drive replaces a part of the path if it costs at most ``costs.bend`` s more, including the turns at its
    ends.

    Args:
        places: (N, 2) positions, m.
        headings: (N,) headings, rad.
        moves: (N,) uint8, the move that led to each pose.
        seconds: (N,) float64, cost of the path to each pose, s.
        heading: heading of the robot at the first pose, rad.
        terrain: the ground.
        costs: parameters of the costs.

    Returns:
        Indices of the bends of the straightened path, both ends included, and whether the drive to each bend is
        backwards; the value for the start has no meaning.
    """
    bends, backwards, p = [0], [False], 0
    while (moves[p + 1 :] <= Move.BACKWARD.value).any():
        drives = p + 1 + np.flatnonzero(moves[p + 1 :] <= Move.BACKWARD.value)
        back = moves[drives[0]] == Move.BACKWARD
        # Only drives in the same direction are merged; the drives before the first turn are straight already.
        others = np.flatnonzero(moves[drives] != moves[drives[0]])
        drives = drives[: others[0]] if len(others) else drives
        turns = np.flatnonzero(np.diff(drives) > 1)
        q = drives[turns[0]] if len(turns) else drives[-1]
        ahead, (x, y) = headings[q], places[p]
        for r in range(drives[-1], q, -1):
            u, v = places[r]
            bearing = np.arctan2(v - y, u - x) + (np.pi if back else 0.0)
            due = seconds[r] - seconds[p] + costs.bend
            cost = turn_seconds(x, y, heading, bearing, terrain, costs)
            if cost <= due:
                cost += turn_seconds(u, v, bearing, headings[r], terrain, costs)
            if cost <= due:
                cost += line_seconds(x, y, u, v, back, terrain, costs)
            if cost <= due:
                q, ahead = r, bearing
                break
        bends.append(q)
        backwards.append(back)
        p, heading = q, ahead
    return np.array(bends), np.array(backwards)
