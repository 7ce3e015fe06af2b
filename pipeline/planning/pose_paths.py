"""Cheapest paths over poses: which poses are reachable, at what cost, and by which path."""

from dataclasses import dataclass
from functools import cached_property
from types import EllipsisType

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Cells, Mask, MaskLayer, Place, Places, Values
from pipeline.elevation_map.pose_kernels import BUCKETS, HEADING_ANGLES, HEADINGS, ORIENTATIONS, VECTORS
from pipeline.elevation_map.traversability import Traversability, min_clearance
from pipeline.errors import required
from pipeline.planning import pose_paths_kernels as kernels


@dataclass(frozen=True, eq=False)
class StraightenedPath:
    """A path that consists of straight drives and turns in place.

    Attributes:
        places: (N, 2) ends of the drives, m; a path that is only a turn has one.
        backwards: (N,) whether each drive is backwards.
        heading: heading to which the robot turns at the end, rad.
    """

    places: Places
    backwards: Mask
    heading: float


class PosePaths:
    """Cheapest paths over poses from one start, or from whichever of several starts makes a path cheapest.

    The search extends only as far as needed, so its duration depends on the distance of the queried positions, not on
    the size of the map.

    Attributes:
        traversability: where the robot may drive.
        start: (2,) m, position of the (first) start; None if no path can begin there or nearby.
        heading: heading of the robot at the start, rad; None for any.
        caution: factor on the measured deviations that the costs allow for; with 0, the costs are expected durations
            without risk.
    """

    def __init__(
        self, traversability: Traversability, start: ArrayLike, heading: float | None = None, caution: float = 1.0
    ):
        """Start at one position (2,) or several positions (K, 2), m, with a given heading, rad, or any heading.

        Further columns of the positions are ignored.

        Without a heading, a start where the robot cannot stand is moved to the nearest position, at most the robot's
        length away, where it can stand. With a heading, the robot may start with too little clearance; it can then
        escape within the diameter of its turning circle. The costs allow for ``caution`` times the measured
        deviations of the robot from its path.
        """
        self._costs, self.caution = traversability.costs(caution), caution
        self.traversability, self._grid = traversability, traversability.grid
        self.heading = heading
        wanted = np.atleast_2d(np.asarray(start, np.float64)[..., :2])
        if heading is None:
            snapped = [
                self._grid.nearest(traversability.traversable, xy, traversability.robot.length) for xy in wanted
            ]
        else:
            snapped = [xy if self._grid.holds(self._grid.cell_of(xy)) else None for xy in wanted]
        places = [xy for xy in snapped if xy is not None]
        self.start = snapped[0]
        self._search = self._new_search(self._start_states(places))
        # A robot with enough clearance reaches at least its start.
        if not places or (self._search.escape_distance > 0 and not self.reachable.any()):
            self.start = None

    def _start_states(self, places: list[Place]) -> NDArray[np.int64]:
        """(K, 3) cells and headings at which the search starts, given the positions (2,), m, of the starts."""
        cells = self._grid.cell_of(np.array(places).reshape(-1, 2))
        if self.heading is not None:
            return np.column_stack([cells, np.full(len(cells), nearest_heading(self.heading))])
        row, heading = np.nonzero(
            heading_mask(self.traversability.free[tuple(cells.T)][:, 0].astype(np.uint16) * 257)
        )
        return np.column_stack([cells[row], heading])

    def _new_search(self, starts: NDArray[np.int64]) -> kernels.Search:
        """A search that has reached only its ``starts``, (K, 3) cells and headings."""
        t, size = self.traversability, self.traversability.clearance.size
        i, j, h = starts.T
        # This ignores the smaller minimum clearance that applies where the robot has been.
        can_escape = (t.clearance[i, j, h % ORIENTATIONS] < min_clearance(t.grid.cell)).any()
        count, first = len(starts), np.full(BUCKETS, -1, np.int32)
        # The arrays are zeros or uninitialised, so that the operating system provides memory only for the pages that
        # the search touches.
        state, after = np.empty((2, 4 * size + count), np.int32)
        search = kernels.Search(
            starts,
            np.zeros(size, np.int32),
            np.zeros(size, np.uint8),
            np.zeros(size, np.int16),
            kernels.level_ticks(self._grid.cell, self._costs),
            2 * t.robot.corner_radius if can_escape else -1.0,
            first,
            state,
            after,
            np.array([1, count, count]),
        )
        poses = np.ravel_multi_index(tuple(starts.T), (*self._grid.shape, HEADINGS))
        search.cost[poses], search.source[poses] = 1, np.arange(count)
        state[:count], after[:count], first[1] = poses, np.arange(-1, count - 1), count - 1
        return search

    def _extend(self, seconds: float) -> None:
        """Extend the search to all poses that cost at most ``seconds``."""
        tick = self._costs.tick
        until = 1 + int(min(seconds, np.iinfo(np.int32).max * tick / 2) / tick)
        kernels.extend(self._search, self.traversability.terrain, self._costs, until)

    @property
    def is_complete(self) -> bool:
        """Whether the search has reached all reachable poses."""
        return bool(self._search.progress[1] == 0)

    @cached_property
    def without_risk(self) -> "PosePaths":
        """The cheapest paths from the (first) start if the risk of hitting an obstacle costs nothing."""
        return PosePaths(self.traversability, required(self.start), self.heading, caution=0.0)

    def _known_costs(self, where: tuple[NDArray, ...] | EllipsisType) -> NDArray[np.float32]:
        """(..., 16) costs of reaching cells with each heading, s; inf where the search has not arrived yet."""
        cost = self._search.cost.reshape(*self._grid.shape, HEADINGS)[where]
        is_known = (cost > 0) & ((cost <= self._search.progress[0]) | self.is_complete)
        return np.where(is_known, (cost - 1) * np.float32(self._costs.tick), np.float32(np.inf))

    def seconds_to(self, cells: Cells, until: float = np.inf) -> NDArray[np.float32]:
        """(N, 16) costs of reaching cells (N, 2) with each heading, s; costs above ``until`` may be inf."""
        self._extend(until)
        return self._known_costs(tuple(cells.T))

    def min_seconds_to(self, cells: Cells) -> Values:
        """(N,) s, lower bounds on the costs of paths to cells (N, 2) from the start; there must be only one start."""
        # No move is cheaper per metre than a forward drive with plenty of room.
        ticks = (self._search.level_costs[kernels.Move.FORWARD, :, -1] / np.linalg.norm(VECTORS, axis=1)).min()
        return ticks * self._costs.tick * np.linalg.norm(cells - self._search.starts[0, :2], axis=1)

    @cached_property
    def seconds(self) -> NDArray[np.float32]:
        """(nx, ny, 16) cost of reaching each cell with each heading, s; inf where no path leads."""
        self._extend(np.inf)
        return self._known_costs(...)

    @cached_property
    def cost(self) -> NDArray[np.float32]:
        """(nx, ny) cost of reaching each cell, s; inf where no path leads."""
        return self.seconds.min(axis=2)

    @cached_property
    def headings(self) -> NDArray[np.uint16]:
        """(nx, ny) bits of the 16 headings with which the robot can reach each cell and stand there."""
        seeds = np.zeros(self._grid.shape, np.uint16)
        if self._search.escape_distance > 0:
            self._extend(np.inf)
            reached = self._search.cost.reshape(*self._grid.shape, HEADINGS) > 0
            seeds = np.packbits(reached, axis=2, bitorder="little").view(np.uint16)[..., 0]
        else:
            i, j, h = self._search.starts.T
            np.bitwise_or.at(seeds, (i, j), np.uint16(1) << h.astype(np.uint16))
        free = self.traversability.free
        anyhow = free.view(np.uint16)[..., 0] == kernels.ALL_HEADINGS
        is_open = cv2.erode(anyhow.view(np.uint8), np.ones((5, 5))).view(np.bool_)
        return kernels.flood(seeds, free, is_open) & (free[..., 0].astype(np.uint16) * np.uint16(257))

    @cached_property
    def reachable(self) -> MaskLayer:
        """Cells that the robot can reach and where it may stand."""
        return self.headings != 0

    def cost_to(self, xy: ArrayLike) -> float:
        """Cost of reaching a point (2,), m, in s; inf if no path leads there."""
        return float(self._settled_seconds(xy).min())

    def seconds_at(self, xy: ArrayLike, heading: int) -> float:
        """Cost, s, of reaching a point (2,), m, with the heading of index ``heading``; inf if no path leads there."""
        return float(self._settled_seconds(xy, heading)[heading])

    def can_reach(self, states: Cells) -> Mask:
        """(N,) whether the robot can reach and stand at cells with headings (N, 3); False off the grid."""
        inside = self._grid.holds(states[:, :2])
        i, j, heading = np.where(inside[:, None], states, 0).T
        return np.asarray(inside & heading_mask(self.headings[i, j])[np.arange(len(states)), heading])

    def cheapest(self, places: Places) -> int | None:
        """Index of the position among ``places`` (N, 2), m, that is cheapest to reach.

        None if no position is reachable, or if any position is off the grid.
        """
        cost = self._settled_seconds(places).min(axis=1)
        return int(cost.argmin()) if np.isfinite(cost).any() else None

    def _settled_seconds(self, xy: ArrayLike, heading: int | None = None) -> NDArray[np.float32]:
        """(..., 16) s, costs of reaching points (..., 2), m, with each heading.

        Only the lowest of all costs or, if given, the lowest cost with the heading of index ``heading`` is final.
        """
        cells, horizon = self._grid.cell_of(xy), self._costs.bend
        if not self._grid.holds(cells).all():
            return np.full((*cells.shape[:-1], HEADINGS), np.inf, np.float32)
        where = tuple(np.moveaxis(cells, -1, 0))
        while True:
            seconds = self._known_costs(where)
            wanted = seconds if heading is None else seconds[..., heading]
            if np.isfinite(wanted).any() or self.is_complete or not self.reachable[where].any():
                return seconds
            self._extend(horizon)
            horizon *= 2

    def sources(self) -> NDArray[np.int64]:
        """(nx, ny) flat index of the cell where the cheapest path to each cell starts; -1 where no path leads."""
        starts = self._search.starts
        flat, seconds = np.append(np.ravel_multi_index(tuple(starts[:, :2].T), self._grid.shape), -1), self.seconds
        source = self._search.source.reshape(seconds.shape)
        best = np.take_along_axis(source, seconds.argmin(axis=2)[..., None], axis=2)[..., 0]
        return flat[np.where(np.isfinite(self.cost), best, -1)]

    def path_to(self, xy: ArrayLike) -> Places:
        """(N, 2) centres of the cells on the cheapest path from any start to a reachable point (2,), m."""
        states = self._states_to(self._grid.cell_of(xy), int(self._settled_seconds(xy).argmin()))
        moved = np.append(True, (np.diff(states[:, :2], axis=0) != 0).any(axis=1))
        return self._grid.centre_of(states[moved, :2])

    def straightened_path_to(self, xy: ArrayLike, heading: float | None = None) -> StraightenedPath:
        """The cheapest path to a reachable point (2,), m, straightened by :func:`kernels.straighten`."""
        goal, cell = np.asarray(xy, np.float64)[:2], self._grid.cell_of(xy)
        wanted = None if heading is None else nearest_heading(heading)
        there = self._settled_seconds(xy, wanted)
        last = wanted if wanted is not None and np.isfinite(there[wanted]) else int(there.argmin())
        states = self._states_to(cell, last)
        places = self._grid.centre_of(states[:, :2])
        places[(states[:, :2] == states[-1, :2]).all(axis=1)] = goal
        if self.start is not None and len(np.unique(self._search.starts[:, :2], axis=0)) == 1:
            places[(states[:, :2] == states[0, :2]).all(axis=1)] = self.start
        first = HEADING_ANGLES[states[0, 2]] if self.heading is None else self.heading
        flat = np.ravel_multi_index(tuple(states.T), (*self._grid.shape, HEADINGS))
        moves, seconds = self._search.came_by[flat], (self._search.cost[flat] - 1) * self._costs.tick
        bends, backwards = kernels.straighten(
            places, HEADING_ANGLES[states[:, 2]], moves, seconds, first, self.traversability.terrain, self._costs
        )
        ends = slice(min(1, len(bends) - 1), None)
        end = float(HEADING_ANGLES[last]) if heading is None else heading
        return StraightenedPath(places[bends[ends]], backwards[ends], end)

    def states_to(self, xy: ArrayLike, heading: int) -> Cells:
        """(N, 3) cells and headings on the path from the start to a point (2,), m.

        ``heading``: index of a heading with which the robot can reach the point.
        """
        self._settled_seconds(xy, heading)
        return self._states_to(self._grid.cell_of(xy), heading)

    def _states_to(self, cell: Cells, heading: int) -> NDArray[np.int64]:
        """(N, 3) cells and headings on the path from the start to a cell (2,) with the heading of index ``heading``.

        The pose must be reachable.
        """
        came_by = self._search.came_by.reshape(*self._grid.shape, HEADINGS)
        states = kernels.trace(came_by, int(cell[0]), int(cell[1]), heading)
        return states[::-1]


def heading_mask(headings: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """(..., 16) whether each of the 16 bits of ``headings`` (...) is set."""
    return (headings[..., None] >> np.arange(HEADINGS, dtype=np.uint16)) & 1 == 1


def nearest_heading(heading: float) -> int:
    """Index of the heading, among the 16 headings of the search, that is nearest to ``heading``, rad."""
    return int(np.cos(HEADING_ANGLES - heading).argmax())


def simplify(path: Places, traversability: Traversability) -> Places:
    """A path (N, 2), m, in which straight drives replace points, so that only the bends remain.

    Each drive costs at most ``stop`` s more than the part of the path that it replaces.
    """
    seconds = traversability.line_seconds(path[:-1], path[1:])
    reached = np.append(0.0, np.cumsum(np.where(np.isfinite(seconds), seconds, 1e3)))
    bends = [0]
    while bends[-1] < len(path) - 1:
        rest = np.arange(bends[-1] + 1, len(path))
        straight = traversability.line_seconds(path[bends[-1]][None], path[rest])
        good = rest[straight <= reached[rest] - reached[bends[-1]] + traversability.config.costs.bend]
        bends.append(int(good[-1]) if len(good) else int(rest[0]))
    return path[bends]
