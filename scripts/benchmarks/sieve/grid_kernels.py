"""Compiled loops over the cells of 2D maps: rays, edges, frontiers and visibility."""

import heapq

import numpy as np
from numba import njit

IS_UNKNOWN, IS_FREE, IS_WALL = 0, 1, 2
"""States of a cell in a robot's map."""


@njit(cache=True)
def line(r, c, r_end, c_end):
    """The initial state of Bresenham's line: its error term, and twice its signed height and width."""
    dr, dc = r_end - r, c_end - c
    return abs(dc) - abs(dr), 2 * dr, 2 * dc


@njit(cache=True)
def after(r, c, error, dr, dc):
    """The next cell of a :func:`line`, and its error term."""
    if error > 0:
        return r, c + (1 if dc > 0 else -1), error - abs(dr)
    return r + (1 if dr > 0 else -1), c, error + abs(dc)


@njit(cache=True)
def sense(free, belief, row, col, bearings, reach, wall):
    """Write into ``belief`` (H, W) what a sensor in a cell sees of ``free`` (H, W); return how many are newly free.

    A ray follows Bresenham's line to the cell ``reach`` cells away along one of the ``bearings`` (N,), rad, 0 along
    the columns. It sees fewer than ``wall`` cells of a wall and nothing behind it; its last cell is not seen.
    """
    new = 0
    for n in range(len(bearings)):
        r, c = row, col
        r_end = int(np.rint(row + reach * np.sin(bearings[n])))
        c_end = int(np.rint(col + reach * np.cos(bearings[n])))
        error, dr, dc = line(r, c, r_end, c_end)
        inside = 0
        while 0 <= r < free.shape[0] and 0 <= c < free.shape[1]:
            if not free[r, c]:
                inside += 1
                if inside >= wall:
                    break
            elif inside > 0:
                break
            if r == r_end and c == c_end:
                break
            if belief[r, c] == IS_UNKNOWN:
                belief[r, c] = IS_FREE if free[r, c] else IS_WALL
                new += free[r, c]
            r, c, error = after(r, c, error, dr, dc)
    return new


@njit(cache=True)
def is_clear(belief, r, c, r_end, c_end):
    """Whether all cells of ``belief`` (H, W) on Bresenham's line between two cells, inclusive, are known free."""
    error, dr, dc = line(r, c, r_end, c_end)
    while belief[r, c] == IS_FREE:
        if r == r_end and c == c_end:
            return True
        r, c, error = after(r, c, error, dr, dc)
    return False


@njit(cache=True)
def open_edges(belief, nodes, neighbours, is_open, middle, radius):
    """Set ``is_open`` (N, K) for edges to ``neighbours`` (N, K; -1: none) that are now known to be free.

    Only ``nodes`` (N, 2) within ``radius`` rows and columns of ``middle`` (2,) are examined.
    """
    for n in range(len(nodes)):
        r, c = nodes[n]
        if abs(r - middle[0]) > radius or abs(c - middle[1]) > radius or belief[r, c] != IS_FREE:
            continue
        for k in range(neighbours.shape[1]):
            m = neighbours[n, k]
            if m >= 0 and not is_open[n, k] and is_clear(belief, r, c, nodes[m, 0], nodes[m, 1]):
                is_open[n, k] = True
                is_open[m, neighbours.shape[1] - 1 - k] = True


@njit(cache=True)
def thin(belief, thinned, factor, middle, radius):
    """Update ``thinned`` (H // factor, W // factor) within ``radius`` cells of cell ``middle`` of ``belief`` (H, W).

    A square is a wall if any of its cells is a wall; otherwise it is unknown if any is unknown, and free if all are.
    """
    low_r, low_c = max(middle[0] - radius, 0) // factor, max(middle[1] - radius, 0) // factor
    for i in range(low_r, min((middle[0] + radius) // factor + 1, thinned.shape[0])):
        for j in range(low_c, min((middle[1] + radius) // factor + 1, thinned.shape[1])):
            state = IS_FREE
            for r in range(i * factor, (i + 1) * factor):
                for c in range(j * factor, (j + 1) * factor):
                    if belief[r, c] == IS_WALL:
                        state = IS_WALL
                    elif belief[r, c] == IS_UNKNOWN and state == IS_FREE:
                        state = IS_UNKNOWN
            thinned[i, j] = state


@njit(cache=True)
def frontier_mask(thinned):
    """(H, W) mask of a map's free cells that have two to seven unknown cells among their eight neighbours."""
    mask = np.zeros(thinned.shape, np.bool_)
    for i in range(1, thinned.shape[0] - 1):
        for j in range(1, thinned.shape[1] - 1):
            if thinned[i, j] == IS_FREE:
                unknown = 0
                for a in range(i - 1, i + 2):
                    for b in range(j - 1, j + 2):
                        unknown += thinned[a, b] == IS_UNKNOWN
                mask[i, j] = 2 <= unknown <= 7
    return mask


@njit(cache=True)
def visible(belief, places, points, reach):
    """(N, M) whether a line of at most ``reach`` cells, all known free, joins places (N, 2) and points (M, 2)."""
    result = np.zeros((len(places), len(points)), np.bool_)
    for n in range(len(places)):
        r, c = places[n]
        for m in range(len(points)):
            dr, dc = points[m, 0] - r, points[m, 1] - c
            if dr * dr + dc * dc <= reach * reach:
                result[n, m] = is_clear(belief, r, c, points[m, 0], points[m, 1])
    return result


@njit(cache=True)
def unknown_in_view(thinned, rows, cols, reach, deepest):
    """(N,) number of unknown cells that rays from each of (N,) cells of a map should see within ``reach`` cells.

    Unknown cells are assumed to be free, but a ray ends after ``deepest`` of them.
    """
    counts = np.zeros(len(rows), np.int64)
    stamp = np.full(thinned.shape, -1)
    rays = int(np.ceil(2 * np.pi * reach))  # one ray per cell at the maximum range
    for n in range(len(rows)):
        for k in range(rays):
            dr, dc = np.sin(2 * np.pi * k / rays), np.cos(2 * np.pi * k / rays)
            unknown = 0
            for d in range(1, reach + 1):
                r, c = int(np.rint(rows[n] + d * dr)), int(np.rint(cols[n] + d * dc))
                if not (0 <= r < thinned.shape[0] and 0 <= c < thinned.shape[1]) or thinned[r, c] == IS_WALL:
                    break
                if thinned[r, c] == IS_UNKNOWN:
                    unknown += 1
                    if unknown > deepest:
                        break
                    if stamp[r, c] != n:
                        stamp[r, c] = n
                        counts[n] += 1
    return counts


@njit(cache=True)
def shortest_ways(neighbours, lengths, is_open, start):
    """Lengths (N,) of the shortest paths from a node, inf if there is none, and each node's predecessor (N,) or -1.

    Dijkstra's algorithm. Edges lead to ``neighbours`` (N, K), have the same ``lengths`` (K,) at every node, and exist
    where ``is_open`` (N, K). The start and unreachable nodes have no predecessor.
    """
    ways, before = np.full(len(neighbours), np.inf), np.full(len(neighbours), -1)
    ways[start] = 0.0
    heap = [(0.0, start)]
    while heap:
        way, n = heapq.heappop(heap)
        if way > ways[n]:
            continue
        for k in range(neighbours.shape[1]):
            m = neighbours[n, k]
            if is_open[n, k] and way + lengths[k] < ways[m]:
                ways[m] = way + lengths[k]
                before[m] = n
                heapq.heappush(heap, (ways[m], m))
    return ways, before
