"""Compiled searches over the traversable ground."""

import heapq
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.traversability.elevation_kernels import cell_at

_NEIGHBOURS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])

ACROSS = 2.0
"""What a move across the slope of a ramp costs over one along it."""


class Rules(NamedTuple):
    """Where the robot may go; layers are (nx, ny).

    Attributes:
        traversable: bool, it may pass.
        ramp: bool, it must move along the slope there, unless there is room.
        room: bool, it may also move across.
        slidable: bool, it may also turn on a ramp: there is room to slide.
        uphill: (nx, ny, 2) float32 unit vectors up the slopes.
        cos_alignment: least cosine between its way and a slope.
    """

    traversable: NDArray[np.bool_]
    ramp: NDArray[np.bool_]
    room: NDArray[np.bool_]
    slidable: NDArray[np.bool_]
    uphill: NDArray[np.float32]
    cos_alignment: float


def free_rules(traversable: NDArray[np.bool_]) -> Rules:
    """Rules that know no ramps; ``traversable`` is (nx, ny)."""
    nowhere = np.zeros_like(traversable)
    return Rules(traversable, nowhere, nowhere, nowhere, np.zeros((*traversable.shape, 2), np.float32), 0.0)


@njit(cache=True)
def is_aligned(dx, dy, i, j, rules):
    """Whether the unit direction (dx, dy) is along the slope in cell (i, j), or the cell is on no ramp."""
    if not rules.ramp[i, j]:
        return True
    return abs(dx * rules.uphill[i, j, 0] + dy * rules.uphill[i, j, 1]) >= rules.cos_alignment


@njit(cache=True)
def is_allowed(dx, dy, i, j, rules):
    """Whether the robot may move in the unit direction (dx, dy) in cell (i, j)."""
    return rules.room[i, j] or is_aligned(dx, dy, i, j, rules)


@njit(cache=True)
def is_set(i, j, mask):
    """Whether (i, j) is a cell of a mask (nx, ny) and set."""
    return 0 <= i < mask.shape[0] and 0 <= j < mask.shape[1] and mask[i, j]


@njit(cache=True)
def line_is_traversable(ax, ay, bx, by, origin, cell, rules):
    """Whether every cell on a straight line between points, m, is traversable, and ramps are met head-on.

    ``origin`` (2,) is the corner of the grid, m.
    """
    dx, dy = bx - ax, by - ay
    length = np.sqrt(dx * dx + dy * dy)
    steps = int(np.ceil(2 * length / cell)) + 1
    for s in range(steps + 1):
        i, j = cell_at(ax + dx * s / steps, ay + dy * s / steps, origin, cell)
        if not is_set(i, j, rules.traversable):
            return False
        # Within one cell the direction means nothing.
        if length > cell and not is_allowed(dx / length, dy / length, i, j, rules):
            return False
    return True


@njit(cache=True)
def lines_are_traversable(starts, ends, origin, cell, rules):
    """(N,) bool of :func:`line_is_traversable` for lines between points (N, 2)."""
    result = np.empty(len(starts), np.bool_)
    for n in range(len(starts)):
        a, b = starts[n], ends[n]
        result[n] = line_is_traversable(a[0], a[1], b[0], b[1], origin, cell, rules)
    return result


@njit(cache=True)
def metres_on(starts, ends, origin, cell, mask, rules=None):
    """(N,) metres of each line between points (N, 2) that lie over a mask (nx, ny).

    With ``rules``, only those that lead across the slope of a ramp.
    """
    result = np.zeros(len(starts))
    for n in range(len(starts)):
        x, y, dx, dy = starts[n, 0], starts[n, 1], ends[n, 0] - starts[n, 0], ends[n, 1] - starts[n, 1]
        length = np.sqrt(dx * dx + dy * dy)
        if length == 0:
            continue
        steps = int(np.ceil(2 * length / cell)) + (rules is None)
        for s in range(steps):
            i, j = cell_at(x + dx * (s + 0.5) / steps, y + dy * (s + 0.5) / steps, origin, cell)
            if is_set(i, j, mask) and (rules is None or not is_aligned(dx / length, dy / length, i, j, rules)):
                result[n] += length / steps
    return result


@njit(cache=True)
def shortest_paths(starts, weight, turn, rules):
    """Dijkstra over the eight neighbours of every traversable cell.

    A move costs its length in cells times the mean ``weight`` (nx, ny) of the two cells, and ``ACROSS`` times that
    across a slope. On a ramp it matters besides whether the robot came along the slope or across it: to change over
    where there is no room to slide costs ``turn`` cells. So each cell is two states: its flat index if the robot came
    along, and nx·ny more if across.

    Args:
        starts: (K, 2) cells.
        weight: (nx, ny) float64.
        turn: cells.
        rules: where the robot may go.

    Returns:
        (2, nx, ny) float32 cost of each state from the nearest of the starts, inf where no path leads, and (2 nx ny)
        int32 the state before, -1 where there is none.
    """
    nx, ny = rules.traversable.shape
    cells = nx * ny
    cost = np.full(2 * cells, np.inf, np.float32)
    parent = np.full(2 * cells, -1, np.int32)
    first = starts[:, 0] * ny + starts[:, 1]
    heap = [(np.float32(0.0), np.int32(state)) for state in np.concatenate((first, first + cells))]
    for _, state in heap:
        cost[state] = 0.0
    heapq.heapify(heap)
    while len(heap) > 0:
        c, state = heapq.heappop(heap)
        if c > cost[state]:
            continue
        i, j = state % cells // ny, state % ny
        for n in range(8):
            di, dj = _NEIGHBOURS[n]
            a, b = i + di, j + dj
            length = np.sqrt(di * di + dj * dj)
            ux, uy = di / length, dj / length
            if not (is_set(a, b, rules.traversable) and is_allowed(ux, uy, a, b, rules)):
                continue
            if not is_allowed(ux, uy, i, j, rules):
                continue
            across = not (is_aligned(ux, uy, a, b, rules) and is_aligned(ux, uy, i, j, rules))
            step = length * 0.5 * (weight[i, j] + weight[a, b]) * (ACROSS if across else 1.0)
            if rules.ramp[i, j] and not rules.slidable[i, j] and across != (state >= cells):
                step += turn
            new = np.float32(c + step)
            then = across * cells + a * ny + b
            if new < cost[then]:
                cost[then] = new
                parent[then] = state
                heapq.heappush(heap, (new, np.int32(then)))
    return cost.reshape(2, nx, ny), parent
