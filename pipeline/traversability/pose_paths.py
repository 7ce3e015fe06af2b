"""Cheapest ways over poses: they tell what is reachable, what it costs to be there facing somewhere, and how."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import EllipsisType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.traversability import pose_paths_kernels as kernels
from pipeline.traversability.pose_kernels import ANGLES, BUCKETS, HEADINGS, STOP, TICK
from pipeline.traversability.traversability import LEAST, STANDING, Traversability, costs_of

SNAP = 0.5
"""m; a place where the robot cannot stand is moved to where it can from no further."""
ESCAPE, ESCAPE_FACTOR = 0.8, 5.0
"""m that a robot which stands where it could not have driven may go as if it could, and what each second counts."""
FIRST_HORIZON, GROWTH = 4.0, 1.5
"""s that the search for a way to a place goes on at first; so many times as far whenever it did not come there."""
SHORTEST = 0.95
"""Of a straight drive at full speed: no way takes less, though each of its moves takes whole ticks."""
ENTRIES = 1 << 16
"""Of the queue at first."""


@dataclass(frozen=True, eq=False)
class Way:
    """Straight drives and turns in place.

    Attributes:
        places: (N, 2) m in ``map``, the ends of the drives; at least one, if only where it turns.
        backwards: (N,) which of the drives lead backwards.
        heading: rad, to turn to at the end.
        seconds: that it should take, risks counted in.
    """

    places: NDArray[np.float64]
    backwards: NDArray[np.bool_]
    heading: float
    seconds: float


class PosePaths:
    """Cheapest ways over poses from one, or from the nearest of several places.

    The search goes on only as far as is asked for: what it takes depends on how far the robot looks, not on the map.

    Attributes:
        traversability: of the ground.
        start: (2,) m, where the (first) one begins; None where the robot can stand nowhere near.
    """

    def __init__(
        self, traversability: Traversability, start: ArrayLike, heading: float | None = None, caution: float = 1.0
    ):
        """Begin at (2,) or (K, 2) places, m, more columns are ignored, with any heading or with one in rad.

        A robot with more ``caution`` believes to stray so many times as far as it does by what was measured.
        """
        self._costs = costs_of(traversability.robot, caution)
        self.traversability, self._grid = traversability, traversability.grid
        self._heading = heading
        wanted = np.atleast_2d(np.asarray(start, np.float64)[..., :2])
        if heading is None:
            snapped = [self._grid.nearest(traversability.traversable, xy, SNAP) for xy in wanted]
        else:
            snapped = [xy if self._grid.at(np.ones(self._grid.shape, bool), xy) else None for xy in wanted]
        places = [xy for xy in snapped if xy is not None]
        self.start = snapped[0]
        self._search = self._begin(self._states(places))
        # One with room to stand reaches that place at least.
        if not places or (self._search.escape > 0 and not self.reachable.any()):
            self.start = None

    def _states(self, places: list[NDArray[np.float64]]) -> NDArray[np.int64]:
        """(K, 3) the cells and headings to begin with."""
        cells = self._grid.cell_of(np.array(places).reshape(-1, 2))
        if self._heading is not None:
            return np.column_stack([cells, np.full(len(cells), nearest_heading(self._heading))])
        row, heading = np.nonzero(bits(self.traversability.free[tuple(cells.T)][:, 0].astype(np.uint16) * 257))
        return np.column_stack([cells[row], heading])

    def _begin(self, starts: NDArray[np.int64]) -> kernels.Search:
        t, size = self.traversability, self.traversability.clearance.size
        i, j, h = starts.T
        # One with room need not escape, however little is left where it has been.
        can_escape = (t.clearance[i, j, h % STANDING] < round(100 * LEAST)).any()
        # Zeros, for the pages of memory that the search does not reach are then never touched.
        search = kernels.Search(
            starts,
            np.zeros(size, np.int32),
            np.zeros(size, np.uint8),
            np.zeros(size, np.int16),
            kernels.level_ticks(self._grid.cell, self._costs),
            ESCAPE if can_escape else -1.0,
            ESCAPE_FACTOR,
            np.ones(1, np.int64),
        )
        self._queue = _queue(max(ENTRIES, 2 * len(starts)))
        kernels.begin(search, self._queue, self._grid.shape[1])
        return search

    def _extend(self, seconds: float) -> None:
        """Let the search go on to all poses that cost no more, s."""
        until = 1 + int(min(seconds, np.iinfo(np.int32).max * TICK / 2) / TICK)
        terrain = self.traversability.terrain
        while not kernels.extend(self._search, self._queue, terrain, self._costs, until):
            q, more = self._queue, np.empty_like(self._queue.state)
            self._queue = q._replace(state=np.concatenate([q.state, more]), after=np.concatenate([q.after, more]))

    @property
    def is_complete(self) -> bool:
        """Whether the search has come to its end."""
        return bool(self._queue.used[0] == 0)

    def _known(self, where: tuple[NDArray, ...] | EllipsisType) -> NDArray[np.float32]:
        """(..., 16) s to cells, as far as the search has come; inf where it has not."""
        cost = self._search.cost.reshape(*self._grid.shape, HEADINGS)[where]
        is_known = (cost > 0) & ((cost <= self._search.now[0]) | self.is_complete)
        return np.where(is_known, (cost - 1) * np.float32(TICK), np.float32(np.inf))

    def seconds_to(self, cells: NDArray[np.int64], until: float = np.inf) -> NDArray[np.float32]:
        """(N, 16) s to be at cells (N, 2) with each heading; inf where no way leads, or none of ``until`` s."""
        self._extend(until)
        return self._known(tuple(cells.T))

    def least_seconds_to(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """(N,) s that no way from the one start to cells (N, 2) can take less than."""
        away = np.linalg.norm(cells - self._search.starts[0, :2], axis=1) * self._grid.cell
        return SHORTEST * away / self._costs.speed

    @cached_property
    def seconds(self) -> NDArray[np.float32]:
        """(nx, ny, 16) s to be at each cell with each heading; inf where no way leads."""
        self._extend(np.inf)
        return self._known(...)

    @cached_property
    def cost(self) -> NDArray[np.float32]:
        """(nx, ny) s to be at each cell; inf where no way leads."""
        return self.seconds.min(axis=2)

    @cached_property
    def headings(self) -> NDArray[np.uint16]:
        """(nx, ny) bits of the 16 headings with which the robot can stand, and that a way leads to."""
        seeds = np.zeros(self._grid.shape, np.uint16)
        if self._search.escape > 0:
            self._extend(np.inf)
            reached = self._search.cost.reshape(*self._grid.shape, HEADINGS) > 0
            seeds = np.packbits(reached, axis=2, bitorder="little").view(np.uint16)[..., 0]
        else:
            i, j, h = self._search.starts.T
            np.bitwise_or.at(seeds, (i, j), np.uint16(1) << h.astype(np.uint16))
        free = self.traversability.free
        return kernels.flood(seeds, free) & (free[..., 0].astype(np.uint16) * np.uint16(257))

    @cached_property
    def reachable(self) -> NDArray[np.bool_]:
        """(nx, ny) cells to which a way leads, and where the robot may stand."""
        return self.headings != 0

    def cost_to(self, xy: ArrayLike) -> float:
        """Cost to a point, s; inf where no way leads."""
        return float(self._settle(xy).min())

    def nearest(self, places: NDArray[np.float64]) -> int | None:
        """Which of (N, 2 or 3) places on the grid, m, is cheapest to come to; None if no way leads to any."""
        cost = self._settle(places).min(axis=1)
        return int(cost.argmin()) if np.isfinite(cost).any() else None

    def _settle(self, xy: ArrayLike, heading: int | None = None) -> NDArray[np.float32]:
        """(..., 16) s to points (...), m, with each heading: the least of all is known, or that of one heading."""
        cells, horizon = self._grid.cell_of(xy), FIRST_HORIZON
        if not ((cells >= 0) & (cells < self._grid.shape)).all():
            return np.full((*cells.shape[:-1], HEADINGS), np.inf, np.float32)
        where = tuple(np.moveaxis(cells, -1, 0))
        while True:
            seconds = self._known(where)
            wanted = seconds if heading is None else seconds[..., heading]
            if np.isfinite(wanted).any() or self.is_complete or not self.reachable[where].any():
                return seconds
            self._extend(horizon)
            horizon *= GROWTH

    def sources(self) -> NDArray[np.int64]:
        """(nx, ny) flat index of the cell of that start from which the way to each cell comes; -1 if none leads."""
        starts = self._search.starts
        if not len(starts):
            return np.full(self._grid.shape, -1)
        flat = np.ravel_multi_index(tuple(starts[:, :2].T), self._grid.shape)
        seconds = self.seconds
        source = self._search.source.reshape(seconds.shape)
        best = np.take_along_axis(source, seconds.argmin(axis=2)[..., None], axis=2)[..., 0]
        return np.where(np.isfinite(self.cost), flat[best], -1)

    def path_to(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(N, 2) cell centres from the (nearest) start to a reachable point, m."""
        states = self._states_to(self._grid.cell_of(xy), int(self._settle(xy).argmin()))
        moved = np.append(True, (np.diff(states[:, :2], axis=0) != 0).any(axis=1))
        return self._grid.centre_of(states[moved, :2])

    def way_to(self, xy: ArrayLike, heading: float | None = None) -> Way:
        """The way to a reachable point, as few straight drives as cost no more than the search found."""
        goal, cell = np.asarray(xy, np.float64)[:2], self._grid.cell_of(xy)
        wanted = None if heading is None else nearest_heading(heading)
        there = self._settle(xy, wanted)
        last = wanted if wanted is not None and np.isfinite(there[wanted]) else int(there.argmin())
        states = self._states_to(cell, last)
        places = self._grid.centre_of(states[:, :2])
        places[(states[:, :2] == states[-1, :2]).all(axis=1)] = goal
        if self.start is not None and len(np.unique(self._search.starts[:, :2], axis=0)) == 1:
            places[(states[:, :2] == states[0, :2]).all(axis=1)] = self.start
        first = ANGLES[states[0, 2]] if self._heading is None else self._heading
        flat = np.ravel_multi_index(tuple(states.T), (*self._grid.shape, HEADINGS))
        moves, seconds = self._search.came_by[flat], (self._search.cost[flat] - 1) * TICK
        bends = kernels.straighten(
            places, ANGLES[states[:, 2]], moves, seconds, first, self.traversability.terrain, self._costs
        )
        back = [kernels.gear(moves, a, b) == kernels.BACKWARD for a, b in pairwise(bends)] or [False]
        bends = bends[1:] if len(bends) > 1 else bends
        end = float(ANGLES[last]) if heading is None else heading
        return Way(places[bends], np.array(back), end, float(seconds[-1]))

    def _states_to(self, cell: NDArray[np.int64], heading: int) -> NDArray[np.int64]:
        """(N, 3) cells and headings from the start to a reachable pose."""
        came_by = self._search.came_by.reshape(*self._grid.shape, HEADINGS)
        states = kernels.trace(came_by, int(cell[0]), int(cell[1]), heading)
        return states[::-1]


def _queue(entries: int) -> kernels.Queue:
    state, after = np.empty(entries, np.int32), np.empty(entries, np.int32)
    return kernels.Queue(np.empty(BUCKETS, np.int32), state, after, np.empty(3, np.int64))


def bits(headings: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """(..., 16) which of the bits of (...) are set."""
    return (headings[..., None] >> np.arange(HEADINGS, dtype=np.uint16)) & 1 == 1


def nearest_heading(heading: float) -> int:
    """Which of the 16 headings is nearest to one in rad."""
    return int(np.cos(ANGLES - heading).argmax())


def simplify(path: NDArray[np.float64], traversability: Traversability) -> NDArray[np.float64]:
    """(M, 2) few points of a path (N, 2), m, that straight drives join, none dearer than what it stands for."""
    seconds = traversability.line_seconds(path[:-1], path[1:])
    reached = np.append(0.0, np.cumsum(np.where(np.isfinite(seconds), seconds, 1e3)))
    bends = [0]
    while bends[-1] < len(path) - 1:
        rest = np.arange(bends[-1] + 1, len(path))
        straight = traversability.line_seconds(path[bends[-1]][None], path[rest])
        good = rest[straight <= reached[rest] - reached[bends[-1]] + STOP]
        bends.append(int(good[-1]) if len(good) else int(rest[0]))
    return path[bends]
