"""Shortest traversable paths on the grid: they tell what is reachable and join what the nodes leave apart."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.traversability import shortest_paths_kernels as kernels
from pipeline.traversability.traversability import Traversability

RAMP_ALIGNMENT = np.deg2rad(23)
"""rad, largest angle between a path over a ramp and its slope: on eight neighbours none can be met more exactly than
22.5°."""
RAMP_COST = 2.0
"""A metre on a ramp counts as much as so many on the level."""
NARROW_COST = 1.5
"""The same for a metre where the robot cannot turn, which keeps paths off the corners of walls."""
TIGHT_TURN = 3.0
"""m that a turn along or across the slope of a ramp counts without room to slide."""
SNAP = 0.5
"""m; a point off the traversable ground is moved onto it from no further."""
SHAVE = 0.3
"""m; so much further a straight drive may lead where the robot cannot turn: 0.37 m beside the end of a thin wall, of
which the camera may have missed the last few centimetres."""
LAST = 0.3
"""m of a path that tell in which direction it ends."""


class ShortestPaths:
    """All shortest paths over the traversable ground from one point, or from the nearest of several.

    Attributes:
        traversability: of the ground.
        start: (2,) the traversable point that stands for the (first) wanted one, m; None where there is none near.
        cost: (nx, ny) float32 m, ramps and narrow places counted dearer; inf where no path leads.
    """

    def __init__(self, traversability: Traversability, start: ArrayLike):
        """``start``: (2,) or (K, 2) points, m; more columns are ignored."""
        self.traversability, self._grid = traversability, traversability.grid
        wanted = np.atleast_2d(np.asarray(start, np.float64)[..., :2])
        snapped = [self._grid.nearest(traversability.traversable, xy, SNAP) for xy in wanted]
        starts = [xy for xy in snapped if xy is not None]
        self.start = snapped[0]
        if not starts:
            self.cost = np.full(traversability.traversable.shape, np.inf, np.float32)
            return
        weight = np.where(traversability.turnable, 1.0, NARROW_COST)
        weight[traversability.ramp] = RAMP_COST
        cell, rules = self._grid.cell, traversability.rules(RAMP_ALIGNMENT)
        cost, self._parent = kernels.shortest_paths(self._grid.cell_of(starts), weight, TIGHT_TURN / cell, rules)
        self.cost = cost.min(axis=0) * np.float32(cell)
        self._arrives_across = cost[1] < cost[0]

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """(nx, ny) cells to which a path leads."""
        return np.isfinite(self.cost)

    def cost_to(self, xy: ArrayLike) -> float:
        """Cost to a point, m; inf where no path leads."""
        return float(self._grid.at(self.cost, xy, outside=np.inf))

    def arrival_at(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(N,) heading in rad at which the paths to (N, 2) reachable points end; 0 at the start itself.

        It is that of the last ``LAST`` m, since a drive cuts the corners of a path over cells.
        """
        state = self._state(xy)
        cells = self._cell(state)
        for _ in range(round(LAST / self._grid.cell)):
            before = self._parent[state]
            state = np.where(before >= 0, before, state)
        way = cells - self._cell(state)
        return np.arctan2(way[:, 1], way[:, 0])

    def pass_by(self, mask: NDArray[np.bool_], xy: ArrayLike) -> NDArray[np.bool_]:
        """(N,) whether the paths to (N, 2) reachable points lead over a mask (nx, ny), both ends included."""
        state = self._state(xy)
        passed = np.zeros(len(state), np.bool_)
        on_way = np.arange(len(state))
        while len(on_way):
            passed[on_way] = mask.ravel()[state[on_way] % mask.size]
            on_way = on_way[~passed[on_way]]
            state[on_way] = self._parent[state[on_way]]
            on_way = on_way[state[on_way] >= 0]
        return passed

    def sources(self) -> NDArray[np.int64]:
        """(nx, ny) flat index of the cell of that start from which the path to each cell comes; -1 if none leads."""
        if not self.reachable.any():
            return np.full(self.cost.shape, -1)
        source = np.where(self._parent >= 0, self._parent, np.arange(len(self._parent)))
        while (source != source[source]).any():
            source = source[source]
        along, across = source.reshape(2, *self.cost.shape) % self.cost.size
        return np.where(self.reachable, np.where(self._arrives_across, across, along), -1)

    def path_to(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(N, 2) cell centres from the (nearest) start to a reachable point, m."""
        state, states = self._state(xy), []
        while state >= 0:
            states.append(state)
            state = self._parent[state]
        return self._grid.centre_of(self._cell(np.array(states[::-1])))

    def _state(self, xy: ArrayLike) -> NDArray[np.int64]:
        """(...) the state in which the paths to points (..., 2) end."""
        cell = tuple(np.moveaxis(self._grid.cell_of(xy), -1, 0))
        flat = np.ravel_multi_index(cell, self.cost.shape)
        return np.asarray(flat + self.cost.size * self._arrives_across[cell])

    def _cell(self, state: NDArray[np.int64]) -> NDArray[np.int64]:
        """(..., 2) the cells of states (...)."""
        return np.stack(np.unravel_index(state % self.cost.size, self.cost.shape), axis=-1)


def may_cut(traversability: Traversability, way: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N - 1,) which of the later points of a way (N, 2), m, the robot can drive to straight from the first.

    Ramps are met head-on and corners are given a wide berth as by the way itself: no straight drive leads further
    across a slope than the way does, nor much further where the robot cannot turn.
    """
    t, first, rest = traversability, way[:1], way[1:]
    narrow = ~t.turnable & ~t.ramp
    allowed = t.lines_are_traversable(first, rest)
    allowed &= t.metres_across(first, rest) <= np.cumsum(t.metres_across(way[:-1], rest)) + t.grid.cell
    allowed &= t.metres_on(first, rest, narrow) <= np.cumsum(t.metres_on(way[:-1], rest, narrow)) + SHAVE
    return allowed


def simplify(
    traversability: Traversability, path: NDArray[np.float64], bend_anywhere: bool = False
) -> NDArray[np.float64]:
    """(M, 2) the fewest points of a path (N, 2), m, that straight drives join.

    Bends lie rather where the robot can turn, unless it may ``bend_anywhere``.
    """
    bends = [0]
    while bends[-1] < len(path) - 1:
        rest = np.arange(bends[-1] + 1, len(path))
        ahead = may_cut(traversability, path[bends[-1] :])
        turnable = traversability.grid.at(traversability.turnable, path[rest])
        turnable[-1] = True
        slidable = turnable | traversability.grid.at(traversability.slidable, path[rest])
        choices = (rest[ahead & turnable], rest[ahead & slidable], rest[ahead], rest[:1])[2 * bend_anywhere :]
        bends.append(int(next(choice for choice in choices if len(choice))[-1]))
    return path[bends]
