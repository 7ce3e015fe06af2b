"""Baselines of exploration, behind the interface of :class:`pipeline.exploration.Exploration`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.exploration import Exploration, View
from pipeline.surface.drivable import DrivableSurface
from pipeline.surface.grid import Grid
from pipeline.surface.path_kernels import free_rules, lines_are_drivable
from pipeline.surface.paths import ShortestPaths
from pipeline.transforms import wrap_angle, yaw_of


@dataclass(frozen=True)
class NearestFrontierConfig:
    """When a frontier counts, and from where it is looked at.

    Attributes:
        reach: unseen ground so near to where the robot can be is a frontier, m.
        wall_margin: unseen ground nearer to a hazard cannot be driven on and is none, m.
        near, far: distances at which the camera sees the ground, m.
        field_of_view: of the camera along the horizon, less a margin, rad.
        camera_height: what rises higher above the ground beside it hides what lies behind, m.
        spacing: of the places from which to look, m.
        patience: looks in vain after which a frontier is given up.
        blind_radius: no second look from so near to where one was in vain, and no look at a frontier so near to one
            that was given up, m.
    """

    reach: float = 0.35
    wall_margin: float = 0.25
    near: float = 1.1
    far: float = 3.2
    field_of_view: float = np.deg2rad(54)
    camera_height: float = 0.6
    spacing: float = 0.25
    patience: int = 6
    blind_radius: float = 0.35


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the robot can look from, the nearest first: here, and a coarse grid of the others.

    Attributes:
        xy: (N, 2) m.
        heading: (N,) rad in which it looks where it cannot turn; NaN where it can.
    """

    xy: NDArray[np.float64]
    heading: NDArray[np.float64]


class NearestFrontier(Exploration):
    """Looks at the frontier to which the way is shortest, from the nearest place that has it in view (Yamauchi 1997).

    How much a view would show does not count, nor does the time for turning.
    """

    def __init__(self, config: NearestFrontierConfig | None = None):
        super().__init__()
        self._rules = config or NearestFrontierConfig()
        self._vain: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        self._aim: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def next_view(
        self,
        surface: DrivableSurface,
        measured: NDArray[np.float32],
        paths: ShortestPaths,
        T_map_base: NDArray[np.float64],
    ) -> View | None:
        """The view of the nearest frontier; None when no frontier is left that can be looked at."""
        self._judge_last_look(surface, measured)
        if paths.start is None:
            return None
        self.frontiers = self._nearest_first(surface, measured, paths)
        places = self._places(surface, paths, paths.start, yaw_of(T_map_base))
        walls = self._walls(surface)
        for frontier in self.frontiers[:, :2]:
            view = self._view_of(frontier, places, surface, walls)
            if view is not None:
                self._aim = frontier, view.position
                return view
        return None

    def _judge_last_look(self, surface: DrivableSurface, measured: NDArray[np.float32]) -> None:
        if self._aim is not None and np.isnan(surface.grid.at(measured, self._aim[0], outside=np.nan)):
            self._vain.append(self._aim)
        self._aim = None

    def _nearest_first(
        self, surface: DrivableSurface, measured: NDArray[np.float32], paths: ShortestPaths
    ) -> NDArray[np.float64]:
        """(N, 3) m, the nearest cell of each piece of unseen ground beside what the robot can reach.

        In the order of the way to them.
        """
        grid, rules = surface.grid, self._rules
        distance, nearest = ndimage.distance_transform_edt(~paths.reachable, return_indices=True)
        border = distance * grid.cell <= rules.reach
        border &= np.isnan(measured) & (surface.to_hazard >= rules.wall_margin)
        for xy in self._given_up():
            border &= np.linalg.norm(_centres(grid) - xy, axis=-1) >= rules.blind_radius
        beside = tuple(nearest[:, border])
        order = np.argsort(paths.cost[beside] + distance[border] * grid.cell, kind="stable")
        pieces = ndimage.label(border, np.ones((3, 3)))[0][border][order]
        first = np.sort(np.unique(pieces, return_index=True)[1])
        cells = np.column_stack([grid.centre_of(np.argwhere(border)), surface.elevation[beside]])
        return cells[order][first]

    def _given_up(self) -> list[NDArray[np.float64]]:
        """(2,) frontiers that were looked at in vain often enough."""
        return [goal for goal, _ in self._vain if len(self._looks_in_vain(goal)) >= self._rules.patience]

    def _looks_in_vain(self, frontier: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """(2,) places from which this frontier was looked at."""
        radius = self._rules.blind_radius
        return [place for goal, place in self._vain if np.linalg.norm(goal - frontier) < radius]

    def _places(
        self, surface: DrivableSurface, paths: ShortestPaths, start: NDArray[np.float64], yaw: float
    ) -> _Places:
        stride = max(1, round(self._rules.spacing / surface.grid.cell))
        lattice = np.zeros_like(surface.turnable)
        lattice[::stride, ::stride] = True
        lattice &= paths.reachable & (paths.cost > 0) & (surface.turnable | surface.ramp)
        nearest_first = np.argsort(paths.cost[lattice], kind="stable")
        xy = surface.grid.centre_of(np.argwhere(lattice))[nearest_first]
        arrival = np.where(surface.grid.at(surface.ramp, xy), paths.arrival_at(xy), np.nan)
        here = yaw if surface.grid.at(surface.ramp, start) else np.nan
        return _Places(np.vstack([start, xy]), np.append(here, arrival))

    def _walls(self, surface: DrivableSurface) -> NDArray[np.bool_]:
        """(nx, ny) what hides the ground behind it."""
        around = np.where(np.isnan(surface.elevation), np.inf, surface.elevation)
        size = 2 * round(self._rules.reach / surface.grid.cell) + 1
        return surface.elevation - ndimage.minimum_filter(around, size) > self._rules.camera_height

    def _view_of(
        self,
        frontier: NDArray[np.float64],
        places: _Places,
        surface: DrivableSurface,
        walls: NDArray[np.bool_],
    ) -> View | None:
        """The view from the nearest place that has the frontier in sight; None if there is none."""
        rules, way = self._rules, frontier - places.xy
        distance, bearing = np.linalg.norm(way, axis=1), np.arctan2(way[:, 1], way[:, 0])
        can_turn = np.isnan(places.heading)
        off = (bearing - np.where(can_turn, bearing, places.heading) + np.pi) % (2 * np.pi) - np.pi
        good = (distance >= rules.near) & (distance <= rules.far) & (np.abs(off) <= rules.field_of_view / 2)
        for place in self._looks_in_vain(frontier):
            good &= np.linalg.norm(places.xy - place, axis=1) > rules.blind_radius
        index = np.flatnonzero(good)
        seen = index[_in_sight(places.xy[index], frontier, surface, walls)]
        if not len(seen):
            return None
        n = seen[0]
        heading = bearing[n] if can_turn[n] else places.heading[n]
        return View(places.xy[n], float(heading), bool(can_turn[n]), 0.0)


class RandomWalk(Exploration):
    """Looks in a random direction from a random place that is not far; never ends."""

    def __init__(self, seed: int, stride: float = 2.0):
        """``stride``: the way to the next place is no longer than this, m."""
        super().__init__()
        self._rng = np.random.default_rng(seed)
        self._farthest = stride

    def next_view(
        self,
        surface: DrivableSurface,
        measured: NDArray[np.float32],
        paths: ShortestPaths,
        T_map_base: NDArray[np.float64],
    ) -> View | None:
        """A view drawn by chance; None only where the robot can drive nowhere."""
        cells = np.argwhere(surface.turnable & (paths.cost <= self._farthest))
        if not len(cells):
            return None
        place = surface.grid.centre_of(cells[self._rng.integers(len(cells))])
        return View(place, wrap_angle(self._rng.uniform(0, 2 * np.pi)), True, 0.0)


def _centres(grid: Grid) -> NDArray[np.float64]:
    """(nx, ny, 2) the middles of all cells, m."""
    return grid.centre_of(np.moveaxis(np.indices(grid.shape), 0, -1))


def _in_sight(
    places: NDArray[np.float64],
    target: NDArray[np.float64],
    surface: DrivableSurface,
    walls: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """(N,) whether no wall stands between places (N, 2) and a target (2,)."""
    ends = np.broadcast_to(target, places.shape)
    return lines_are_drivable(
        places, np.ascontiguousarray(ends), surface.grid.origin, surface.grid.cell, free_rules(~walls)
    )
