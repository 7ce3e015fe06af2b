"""Compiled searches over the drivable surface."""

import heapq

import numpy as np
from numba import njit

_NEIGHBOURS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])


@njit(cache=True)
def is_aligned(dx, dy, uphill, cos_alignment):
    """Whether the unit direction (dx, dy) runs straight up or down a slope."""
    return abs(dx * uphill[0] + dy * uphill[1]) >= cos_alignment


@njit(cache=True)
def line_is_drivable(ax, ay, bx, by, origin, cell, drivable, ramp, uphill, cos_alignment):
    """Whether every cell on the straight line is drivable, and ramps are met head-on."""
    dx, dy = bx - ax, by - ay
    length = np.sqrt(dx * dx + dy * dy)
    steps = int(np.ceil(2 * length / cell)) + 1
    for s in range(steps + 1):
        i = int(np.floor((ax + dx * s / steps - origin[0]) / cell))
        j = int(np.floor((ay + dy * s / steps - origin[1]) / cell))
        if not (0 <= i < drivable.shape[0] and 0 <= j < drivable.shape[1]) or not drivable[i, j]:
            return False
        # Within one cell the direction means nothing.
        directed = ramp[i, j] and length > cell
        if directed and not is_aligned(dx / length, dy / length, uphill[i, j], cos_alignment):
            return False
    return True


@njit(cache=True)
def lines_are_drivable(starts, ends, origin, cell, drivable, ramp, uphill, cos_alignment):
    """(N,) bool of :func:`line_is_drivable` for lines between points (N, 2)."""
    result = np.empty(len(starts), np.bool_)
    for n in range(len(starts)):
        result[n] = line_is_drivable(
            starts[n, 0],
            starts[n, 1],
            ends[n, 0],
            ends[n, 1],
            origin,
            cell,
            drivable,
            ramp,
            uphill,
            cos_alignment,
        )
    return result


@njit(cache=True)
def may_move(i, j, a, b, ux, uy, drivable, ramp, uphill, cos_alignment):
    """Whether the robot may pass from cell (i, j) to its neighbour (a, b) in unit direction (ux, uy)."""
    if not (0 <= a < drivable.shape[0] and 0 <= b < drivable.shape[1]) or not drivable[a, b]:
        return False
    if ramp[a, b] and not is_aligned(ux, uy, uphill[a, b], cos_alignment):
        return False
    return not ramp[i, j] or is_aligned(ux, uy, uphill[i, j], cos_alignment)


@njit(cache=True)
def shortest_paths(starts, weight, drivable, ramp, uphill, cos_alignment):
    """Dijkstra over the eight neighbours of every drivable cell.

    A move costs its length in cells times the mean ``weight`` (nx, ny) of the two cells. Returns the (nx, ny) float32
    cost from the nearest of the ``starts`` (K, 2) (inf where no path leads) and the (nx, ny) int32 flat index of each
    cell's predecessor (-1 where there is none).
    """
    nx, ny = drivable.shape
    cost = np.full((nx, ny), np.inf, np.float32)
    parent = np.full((nx, ny), -1, np.int32)
    heap = [(np.float32(0.0), np.int32(starts[0, 0] * ny + starts[0, 1]))]
    for k in range(len(starts)):
        cost[starts[k, 0], starts[k, 1]] = 0.0
        heapq.heappush(heap, (np.float32(0.0), np.int32(starts[k, 0] * ny + starts[k, 1])))
    while len(heap) > 0:
        c, flat = heapq.heappop(heap)
        i, j = flat // ny, flat % ny
        if c > cost[i, j]:
            continue
        for n in range(8):
            di, dj = _NEIGHBOURS[n]
            a, b = i + di, j + dj
            length = np.sqrt(di * di + dj * dj)
            if not may_move(i, j, a, b, di / length, dj / length, drivable, ramp, uphill, cos_alignment):
                continue
            new = np.float32(c + length * 0.5 * (weight[i, j] + weight[a, b]))
            if new < cost[a, b]:
                cost[a, b] = new
                parent[a, b] = flat
                heapq.heappush(heap, (new, np.int32(a * ny + b)))
    return cost, parent
