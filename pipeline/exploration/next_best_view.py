"""Frontier exploration on the metric map: where to look next."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.view_areas import ViewAreas
from pipeline.transforms import wrap_angle, wrap_angles, yaw_of
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability

_ALONG = np.cos(np.deg2rad(35))
"""Cosine of how far off its heading or its tail the robot drives where it cannot turn."""
_NEVER = -np.inf
"""rad; no heading."""
_HERE = 0.05
"""m; nothing nearer is worth turning towards first."""


@dataclass(frozen=True)
class ExplorationConfig:
    """How views are weighed.

    Attributes:
        camera_height, camera_ahead: of the camera above the ground and before the robot's middle, m.
        near, far: distances from the camera at which it sees the ground, m.
        field_of_view: of the camera along the horizon, less a margin, rad.
        lower_edge, upper_edge: of the view of a robot that stands level, rad above the horizon, less a margin.
        min_grazing: angle between a ray and ground that sends it back, rad.
        max_unknown: a ray is believed to see no further than this into unknown ground, m.
        rays: directions around a view.
        spacing: of the points from which views are considered, m.
        longest_straight: drive to a place where the robot cannot turn, m.
        wall_margin: unknown ground nearer to a hazard cannot be driven on and is not worth a look, m.
        min_gain: a view that promises less is not worth the drive, m².
        blind_radius: ground that a look should have shown and did not is not looked for from as near to where that
            look was taken, m.
        hope: with each such miss it counts for so much less.
        max_misses: after so many it is given up.
        speed: expected, m/s.
        turn_rate: expected, rad/s.
        ramp_turn: a turn on a ramp counts as so many on the level: it is slow, and the robot slides.
        look_time: that a look costs whatever the way, s.
    """

    camera_height: float = 0.6
    camera_ahead: float = 0.17
    near: float = 0.9
    far: float = 3.1
    field_of_view: float = np.deg2rad(54)
    lower_edge: float = np.deg2rad(-34)
    upper_edge: float = np.deg2rad(9)
    min_grazing: float = np.deg2rad(8.5)
    max_unknown: float = 1.0
    rays: int = 180
    spacing: float = 0.25
    longest_straight: float = 2.0
    wall_margin: float = 0.25
    min_gain: float = 0.03
    blind_radius: float = 0.35
    hope: float = 0.6
    max_misses: int = 6
    speed: float = 0.2
    turn_rate: float = 0.5
    ramp_turn: float = 3.0
    look_time: float = 2.0


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A place to look from.

    Attributes:
        position: (2,) m in ``map``.
        heading: rad.
        turn: whether the robot turns to the heading when it is there; on a ramp it looks along its way.
        gain: m² of ground expected to be seen for the first time, and what else the look counts for.
        backwards: whether the robot backs up to the place, and so looks back along its way; None if that is the same.
        via: (2,) m, where it turns before it drives to the place straight on; None if any way will do.
    """

    position: NDArray[np.float64]
    heading: float
    turn: bool
    gain: float
    backwards: bool | None = None
    via: NDArray[np.float64] | None = None


class ViewpointRewards(Protocol):
    """What else than unseen ground is worth a look."""

    @property
    def wanted(self) -> Sequence[object]:
        """What is; if empty, nothing."""
        ...

    def gains(self, places: NDArray[np.float64], bearings: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, M) m² that looks from (N, 3) places on the ground along (M,) bearings (rad) count for."""
        ...


@dataclass(frozen=True, eq=False)
class _Miss:
    """How often a cell was looked for in vain, and where from the last time."""

    count: int
    position: NDArray[np.float64]


class Exploration:
    """Chooses views by what would be seen per second of driving.

    Attributes:
        frontiers: (N, 3) centres of the frontiers left, m in ``map``.
        rewards: what else is worth a look.
    """

    def __init__(self, config: ExplorationConfig | None = None):
        self.config = config or ExplorationConfig()
        self.frontiers = np.zeros((0, 3))
        self.rewards: ViewpointRewards | None = None
        self._misses: dict[tuple[float, float], _Miss] = {}
        self._expected: NDArray[np.float64] = np.zeros((0, 2))
        self._areas: ViewAreas | None = None

    def next_viewpoint(
        self,
        traversability: Traversability,
        measured: NDArray[np.float32],
        paths: ShortestPaths,
        T_map_base: NDArray[np.float64],
    ) -> Viewpoint | None:
        """The view that shows most per second, or None when nothing is left that is worth a look.

        Args:
            traversability: what the robot may drive on.
            measured: (nx, ny) height of the ground that returns have shown, NaN elsewhere.
            paths: shortest paths from where the robot is.
            T_map_base: pose of the robot.
        """
        self._count_misses(traversability, measured, T_map_base[:2, 3])
        ground = self._ground(traversability, measured)
        self.frontiers = _frontiers(traversability, paths, ground.target)
        if paths.start is None or not (ground.target.any() or (self.rewards and self.rewards.wanted)):
            return None
        viewpoint = self._best_view(traversability, paths, ground, T_map_base) or self._straight_view(
            traversability, paths, ground
        )
        if viewpoint is not None:
            self._expected = traversability.grid.centre_of(np.argwhere(self._in_view(viewpoint, ground)))
        return viewpoint

    def _best_view(
        self,
        traversability: Traversability,
        paths: ShortestPaths,
        ground: kernels.Ground,
        T_map_base: NDArray[np.float64],
    ) -> Viewpoint | None:
        """The best view from here and from a coarse grid of places where the robot can turn, or on ramps."""
        assert paths.start is not None
        cells = self._lattice(traversability, paths)
        candidates = np.vstack([paths.start, traversability.grid.centre_of(cells)])
        arrival = self._arrival(candidates, traversability, paths, yaw_of(T_map_base))
        gains = self._gains(paths.start, cells, ground)
        if self.rewards and self.rewards.wanted:
            gains = gains + self.rewards.gains(traversability.on_ground(candidates), self._bearings)
        gains = np.where(self._possible(arrival), gains, 0.0)
        distance = np.append(0.0, traversability.grid.at(paths.cost, candidates[1:]))
        seconds = self._seconds(candidates, distance, traversability, T_map_base)
        worth = self._worth(gains, distance, seconds)
        n, m = np.unravel_index(worth.argmax(), worth.shape)
        if worth[n, m] <= 0:
            return None
        heading = wrap_angle(m * 2 * np.pi / self.config.rays)
        turns = bool(np.isnan(arrival[n]))
        return Viewpoint(
            candidates[n], heading, turns, float(gains[n, m]), backwards=None if turns else False
        )

    def _straight_view(
        self, traversability: Traversability, paths: ShortestPaths, ground: kernels.Ground
    ) -> Viewpoint | None:
        """The best view from where the robot cannot turn, but drives to straight from where it can, or backs up to.

        Only ground that was taken for flat when the robot was set down is looked for like this: with its back to the
        wall of a small room the robot sees what is otherwise nearer than the camera sees, and from a ramp that it
        backs up what lies before the ramp.
        """
        config, grid = self.config, traversability.grid
        ground = ground._replace(target=ground.target & paths.reachable)
        places = self._narrow_places(traversability, paths, ground)
        ways = kernels.straight_ways(
            places,
            config.rays,
            config.longest_straight,
            traversability.turnable & paths.reachable,
            traversability.hazard,
            traversability.rules(),
            grid.origin,
            grid.cell,
        )
        # Backwards the robot comes from where it looks.
        ways = np.stack([ways, np.roll(ways, config.rays // 2, axis=1)])
        areas = kernels.ray_areas(places, config.rays, self._sight, ground)
        gains = kernels.view_gains(areas, self._rays_in_view)
        seconds = config.look_time + grid.at(paths.cost, places) / config.speed
        worth = np.where(np.isfinite(ways) & (gains >= config.min_gain), gains / seconds[:, None], 0.0)
        if not worth.any():
            return None
        b, n, m = np.unravel_index(worth.argmax(), worth.shape)
        heading = wrap_angle(m * 2 * np.pi / config.rays)
        ahead = np.array([np.cos(heading), np.sin(heading)]) * (-1 if b else 1)
        via = places[n] - ways[b, n, m] * ahead
        return Viewpoint(places[n], heading, False, float(gains[n, m]), bool(b), via)

    def _narrow_places(
        self, traversability: Traversability, paths: ShortestPaths, ground: kernels.Ground
    ) -> NDArray[np.float64]:
        """(N, 2) m where the robot can stand but not turn, and something unseen is in reach."""
        stands = paths.reachable & (paths.cost > 0) & ~traversability.turnable & ~traversability.slidable
        near = traversability.grid.distance_to(ground.target) <= self._sight.reach
        return traversability.grid.centre_of(np.argwhere(stands & near))

    def _worth(
        self, gains: NDArray[np.float64], distance: NDArray[np.float64], seconds: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N, rays) by which views are chosen: 0 where none is worth the drive.

        Args:
            gains: (N, rays) m² that each should show.
            distance: (N,) m to their places, ramps and narrow places counted dearer.
            seconds: (N, rays) s until the look is taken.
        """
        return np.where(gains >= self.config.min_gain, gains / seconds, 0.0)

    def _count_misses(
        self, traversability: Traversability, measured: NDArray[np.float32], position: NDArray[np.float64]
    ) -> None:
        """Remember which cells the last look should have shown and did not."""
        for cell in self._expected[np.isnan(traversability.grid.at(measured, self._expected))]:
            key = (round(cell[0], 3), round(cell[1], 3))
            count = self._misses[key].count + 1 if key in self._misses else 1
            self._misses[key] = _Miss(count, position)
        self._expected = np.zeros((0, 2))

    def _ground(self, traversability: Traversability, measured: NDArray[np.float32]) -> kernels.Ground:
        """What is known of the ground; what nobody has seen and may be drivable is worth a look until given up."""
        grid = traversability.grid
        target = np.isnan(measured) & (traversability.to_hazard >= self.config.wall_margin)
        hope = np.ones(grid.shape, np.float32)
        missed_from = np.full((*grid.shape, 2), np.inf, np.float32)
        if self._misses:
            i, j = grid.cell_of(list(self._misses)).T
            count = np.array([miss.count for miss in self._misses.values()])
            target[i, j] &= count < self.config.max_misses
            hope[i, j] = self.config.hope**count
            missed_from[i, j] = [miss.position for miss in self._misses.values()]
        blind_radius = self.config.blind_radius
        return kernels.Ground(
            grid.origin,
            grid.cell,
            traversability.elevation,
            traversability.gradient,
            target,
            hope,
            missed_from,
            blind_radius,
        )

    @property
    def _sight(self) -> kernels.Sight:
        config = self.config
        return kernels.Sight(
            config.camera_height,
            config.camera_ahead,
            config.near,
            config.far,
            config.lower_edge,
            config.upper_edge,
            config.min_grazing,
            config.max_unknown,
        )

    def _lattice(self, traversability: Traversability, paths: ShortestPaths) -> NDArray[np.int64]:
        """(N, 2) cells of a coarse grid to look from."""
        stride = self._stride(traversability.grid.cell)
        sparse = (slice(None, None, stride),) * 2
        stands = paths.reachable[sparse] & (paths.cost[sparse] > 0)
        return np.argwhere(stands & (traversability.turnable[sparse] | traversability.ramp[sparse])) * stride

    def _stride(self, cell: float) -> int:
        return max(1, round(self.config.spacing / cell))

    def _arrival(
        self,
        candidates: NDArray[np.float64],
        traversability: Traversability,
        paths: ShortestPaths,
        yaw: float,
    ) -> NDArray[np.float64]:
        """(N,) the heading at which the robot arrives at places, here first, where it cannot turn; NaN elsewhere.

        ``_NEVER`` where it would have to turn on the way but cannot.
        """
        can_turn = traversability.turnable | traversability.slidable
        ahead = paths.arrival_at(candidates[1:])
        # Who cannot turn on the way arrives as it stands now, forwards or backwards.
        stays, along = ~paths.pass_by(can_turn, candidates[1:]), np.cos(ahead - yaw)
        ahead = np.where(stays & (along < 0), ahead + np.pi, ahead)
        ahead[stays & (np.abs(along) < _ALONG)] = _NEVER
        return np.where(traversability.grid.at(can_turn, candidates), np.nan, np.append(yaw, ahead))

    def _possible(self, arrival: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N, rays) the directions in which the robot can look from each place."""
        fixed = np.isfinite(arrival)
        off = wrap_angles(self._bearings - np.where(fixed, arrival, 0.0)[:, None])
        nearest = fixed[:, None] & (np.abs(off) <= np.pi / self.config.rays)
        return np.isnan(arrival)[:, None] | nearest

    def _gains(
        self, here: NDArray[np.float64], cells: NDArray[np.int64], ground: kernels.Ground
    ) -> NDArray[np.float64]:
        """(1 + N, rays) m² that each view should show, from here and from the cells (N, 2)."""
        rays = self.config.rays
        if self._areas is None:
            self._areas = ViewAreas(rays, self._stride(ground.cell), self._sight)
        areas = [kernels.ray_areas(here[None], rays, self._sight, ground), self._areas.of(cells, ground)]
        return kernels.view_gains(np.vstack(areas), self._rays_in_view)

    @property
    def _bearings(self) -> NDArray[np.float64]:
        """(rays,) rad, along which views look."""
        return np.arange(self.config.rays) * 2 * np.pi / self.config.rays

    @property
    def _rays_in_view(self) -> int:
        return round(self.config.field_of_view / (2 * np.pi) * self.config.rays)

    def _in_view(self, viewpoint: Viewpoint, ground: kernels.Ground) -> NDArray[np.bool_]:
        """(nx, ny) the target cells that the view should show."""
        rays, half = self.config.rays, self._rays_in_view // 2
        middle = round(viewpoint.heading / (2 * np.pi) * rays)
        # The very rays that promised the gain, bit for bit: one may slip through where two cells meet at a corner.
        # Those in between find what lies between them.
        step = 2 * np.pi / rays
        first = np.arange(middle - half, middle + half + 1) % rays * step
        bearings = (first[:, None] + np.arange(4) / 4 * step).ravel()
        return kernels.cells_in_view(*viewpoint.position, bearings, self._sight, ground)

    def _seconds(
        self,
        candidates: NDArray[np.float64],
        distance: NDArray[np.float64],
        traversability: Traversability,
        T_map_base: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """(N, rays) time to each view, the way to whose place costs ``distance`` (N,) m."""
        config = self.config
        way = candidates - T_map_base[:2, 3]
        moves = distance > _HERE
        first = np.where(moves, np.arctan2(way[:, 1], way[:, 0]), yaw_of(T_map_base))
        turn = np.abs(wrap_angles(first - yaw_of(T_map_base)))[:, None]
        turn = turn + np.abs(wrap_angles(self._bearings - first[:, None]))
        slow = np.where(traversability.grid.at(traversability.slidable, candidates), config.ramp_turn, 1.0)
        return config.look_time + distance[:, None] / config.speed + turn * slow[:, None] / config.turn_rate


def _frontiers(
    traversability: Traversability, paths: ShortestPaths, target: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(N, 3) centres of the connected pieces of reachable ground that border on unseen ground."""
    around = ndimage.binary_dilation(
        target, np.ones((3, 3)), iterations=round(0.35 / traversability.grid.cell)
    )
    pieces, _ = ndimage.label(around & paths.reachable & ~target, np.ones((3, 3)))
    centres = []
    for piece, box in enumerate(ndimage.find_objects(pieces), start=1):
        cells = np.argwhere(pieces[box] == piece) + [side.start for side in box]
        middle = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
        centres.append([*traversability.grid.centre_of(middle), traversability.elevation[tuple(middle)]])
    return np.array(centres).reshape(-1, 3)
