"""Cheapest ways over poses: they tell what is reachable, what it costs to be there facing somewhere, and how."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.traversability import pose_paths_kernels as kernels
from pipeline.traversability.pose_paths_kernels import ANGLES, TICK
from pipeline.traversability.traversability import STANDING, Traversability, costs_of

SNAP = 0.5
"""m; a place where the robot cannot stand is moved to where it can from no further."""
ESCAPE, ESCAPE_FACTOR = 0.8, 5.0
"""m that a robot which stands where it could not have driven may go as if it could, and what each second counts."""


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
    """All cheapest ways over poses from one, or from the nearest of several places.

    Attributes:
        traversability: of the ground.
        start: (2,) m, where the (first) one begins; None where the robot can stand nowhere near.
        seconds: (nx, ny, 16) float32 cost of being at a cell with each heading; inf where no way leads.
        cost: (nx, ny) float32 s, the least of these.
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
        self._starts = self._states(places)
        escape = round(ESCAPE / self._grid.cell)
        cost, self._came_by, self._source = kernels.search(
            self._starts, traversability.terrain, self._costs, escape, ESCAPE_FACTOR
        )
        self.seconds = np.where(cost == 0, np.float32(np.inf), (cost - 1).astype(np.float32) * np.float32(TICK))
        self.cost = self.seconds.min(axis=2)
        if not self.reachable.any():
            self.start = None

    def _states(self, places: list[NDArray[np.float64]]) -> NDArray[np.int64]:
        """(K, 3) the cells and headings to begin with."""
        cells = self._grid.cell_of(np.array(places).reshape(-1, 2))
        if self._heading is not None:
            return np.column_stack([cells, np.full(len(cells), nearest_heading(self._heading))])
        t = self.traversability
        fits = t.clearance[tuple(cells.T)][:, :STANDING] >= t.least[tuple(cells.T)][:, None]
        row, heading = np.nonzero(np.tile(fits, 2))
        return np.column_stack([cells[row], heading])

    @property
    def can_stand(self) -> NDArray[np.bool_]:
        """(nx, ny, 16) where enough room is left around the robot with each heading."""
        t = self.traversability
        return np.tile(t.clearance[..., :STANDING] >= t.least[..., None], 2)

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """(nx, ny) cells to which a way leads, and where the robot may stand."""
        return np.isfinite(self.cost) & self.traversability.traversable

    def cost_to(self, xy: ArrayLike) -> float:
        """Cost to a point, s; inf where no way leads."""
        return float(self._grid.at(self.cost, xy, outside=np.inf))

    def sources(self) -> NDArray[np.int64]:
        """(nx, ny) flat index of the cell of that start from which the way to each cell comes; -1 if none leads."""
        if not len(self._starts):
            return np.full(self.cost.shape, -1)
        flat = np.ravel_multi_index(tuple(self._starts[:, :2].T), self.cost.shape)
        best = np.take_along_axis(self._source, self.seconds.argmin(axis=2)[..., None], axis=2)[..., 0]
        return np.where(np.isfinite(self.cost), flat[best], -1)

    def path_to(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(N, 2) cell centres from the (nearest) start to a reachable point, m."""
        cell = self._grid.cell_of(xy)
        states = self._states_to(cell, int(self.seconds[tuple(cell)].argmin()))
        moved = np.append(True, (np.diff(states[:, :2], axis=0) != 0).any(axis=1))
        return self._grid.centre_of(states[moved, :2])

    def way_to(self, xy: ArrayLike, heading: float | None = None) -> Way:
        """The way to a reachable point, as few straight drives as cost no more than the search found."""
        goal, cell = np.asarray(xy, np.float64)[:2], self._grid.cell_of(xy)
        there = self.seconds[tuple(cell)]
        last = int(there.argmin()) if heading is None else nearest_heading(heading)
        last = last if np.isfinite(there[last]) else int(there.argmin())
        states = self._states_to(cell, last)
        places = self._grid.centre_of(states[:, :2])
        places[(states[:, :2] == states[-1, :2]).all(axis=1)] = goal
        if self.start is not None and len(np.unique(self._starts[:, :2], axis=0)) == 1:
            places[(states[:, :2] == states[0, :2]).all(axis=1)] = self.start
        first = ANGLES[states[0, 2]] if self._heading is None else self._heading
        moves = self._came_by[tuple(states.T)].copy()
        seconds = self.seconds[tuple(states.T)].astype(np.float64)
        bends = kernels.straighten(
            places, ANGLES[states[:, 2]], moves, seconds, first, self.traversability.terrain, self._costs
        )
        back = [kernels.gear(moves, a, b) == kernels.BACKWARD for a, b in pairwise(bends)] or [False]
        bends = bends[1:] if len(bends) > 1 else bends
        end = float(ANGLES[last]) if heading is None else heading
        return Way(places[bends], np.array(back), end, float(seconds[-1]))

    def _states_to(self, cell: NDArray[np.int64], heading: int) -> NDArray[np.int64]:
        """(N, 3) cells and headings from the start to a reachable pose."""
        states = kernels.trace(self._came_by, int(cell[0]), int(cell[1]), heading)
        return states[::-1]


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
        good = rest[straight <= reached[rest] - reached[bends[-1]] + kernels.STOP]
        bends.append(int(good[-1]) if len(good) else int(rest[0]))
    return path[bends]
