"""Frontier exploration on the metric map: the next best view."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.exploration import visibility
from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.exploration.visibility import BEARINGS, RAYS, STRIDE
from pipeline.grid_map import GridMap, Layer
from pipeline.localisation.correction import Correction, moved_by
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle, wrap_angles, yaw_of
from pipeline.traversability.elevation_map import CELL
from pipeline.traversability.shortest_paths import ShortestPaths

MIN_GAIN = 0.03
"""m²; a viewpoint that should show less is not worth the drive."""
WALL_MARGIN = 0.25
"""m; unknown ground nearer to a hazard cannot be driven on and is not worth a keyframe."""
SHOW_PROBABILITY = 0.6
"""Of a cell in view and missed before to be shown by the next keyframe, for each miss."""
MAX_MISSES = 6
"""After so many a cell is given up."""
LONGEST_STRAIGHT = 2.0
"""m, drive to a place where the robot cannot turn."""
TURN_RATE = 0.5
"""rad/s, expected."""
RAMP_TURN = 3.0
"""A turn on a ramp counts as so many on the level: it is slow, and the robot slides."""
FRONTIER_WIDTH = 0.35
"""m from unseen ground; reachable ground so near is a frontier."""
KEYFRAME_TIME = 2.0
"""s that a keyframe costs whatever the way."""
STRAY = 0.02
"""m added to each half of the robot's size on a straight way: it heads a few degrees off the line that it follows."""
_ALONG = np.cos(np.deg2rad(35))
"""Cosine of how far off its heading or its tail the robot drives where it cannot turn."""
_NEVER = -np.inf
"""rad; no heading."""
_HERE = 0.05
"""m; nothing nearer is worth turning towards first."""


class ViewpointRewards(Protocol):
    """What else than unseen ground makes a viewpoint worth a drive."""

    @property
    def wanted(self) -> Sequence[object]:
        """What is to be seen; if empty, nothing."""
        ...

    def gains(self, places: NDArray[np.float64], bearings: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, M) m² that keyframes from (N, 3) places on the ground along (M,) bearings (rad) count for."""
        ...

    def aim(self, place: NDArray[np.float64], heading: float) -> None:
        """Remember that the next keyframe is to be taken from a place (3,) on the ground along a heading (rad)."""
        ...


class Exploration:
    """Chooses the viewpoint that should show most per second of driving.

    Attributes:
        rewards: what else is worth a keyframe.
    """

    def __init__(self, robot: RobotModel):
        """``robot``: its size keeps it off hazards on straight ways, its speed tells how long they take."""
        self.rewards: ViewpointRewards | None = None
        self._robot = robot
        self._layers = GridMap(
            CELL,
            {
                "elevation": Layer(np.float32, np.nan),
                "gradient": Layer(np.float32, per_cell=(2,)),
                "target": Layer(np.bool_),
                "probability": Layer(np.float32, 1),
                "misses": Layer(np.uint8),
                "missed_from": Layer(np.float32, np.inf, per_cell=(2,)),
            },
        )
        self._expected = np.zeros((0, 2), np.int64)
        self._missed: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        self._ray_gains, self._revision = visibility.RayGains(), 0

    def observe(self, context: Context) -> None:
        """Remember which cells the last keyframe should have shown and did not, and where unseen ground is left."""
        self._layers.match(context.traversability.grid)
        self._count_misses(context.measured, context.T_map_base[:2, 3])
        self._write_terrain(context)

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The viewpoint that shows most per second; None when nothing is left that is worth a keyframe."""
        is_left = self._terrain.target.any() or (self.rewards and self.rewards.wanted)
        if context.paths.start is None or not is_left:
            return None
        camera = visibility.camera_view(context.frame, self._robot)
        return self._best_viewpoint(context, camera) or self._straight_viewpoint(context, camera)

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember what a keyframe from this viewpoint should show."""
        camera = visibility.camera_view(context.frame, self._robot)
        in_view = visibility.cells_in_view(viewpoint.position, viewpoint.heading, camera, self._terrain)
        self._expected = self._layers.grid.low + np.argwhere(in_view)
        if self.rewards is not None:
            place = context.traversability.on_ground(viewpoint.position[None])[0]
            self.rewards.aim(place, viewpoint.heading)

    def find_frontiers(self, context: Context) -> NDArray[np.float64]:
        """(N, 3) centres of the connected pieces of reachable ground that border on unseen ground, m in ``map``."""
        traversability, target = context.traversability, self._terrain.target
        reach = round(FRONTIER_WIDTH / traversability.grid.cell)
        around = ndimage.binary_dilation(target, np.ones((3, 3)), iterations=reach)
        pieces, _ = ndimage.label(around & context.paths.reachable & ~target, np.ones((3, 3)))
        centres = []
        for piece, box in enumerate(ndimage.find_objects(pieces), start=1):
            cells = np.argwhere(pieces[box] == piece) + [side.start for side in box]
            middle = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
            centres.append([*traversability.grid.centre_of(middle), traversability.elevation[tuple(middle)]])
        return np.array(centres).reshape(-1, 3)

    def worth(
        self, gains: NDArray[np.float64], distance: NDArray[np.float64], seconds: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N, RAYS) by which viewpoints are chosen: 0 where none is worth the drive.

        Args:
            gains: (N, RAYS) m² that each should show.
            distance: (N,) m to their places, ramps and narrow places counted dearer.
            seconds: (N, RAYS) s until the keyframe is taken.
        """
        return np.where(gains >= MIN_GAIN, gains / seconds, 0.0)

    def _best_viewpoint(self, context: Context, camera: kernels.CameraView) -> Viewpoint | None:
        """The best viewpoint from here and from a coarse grid of places where the robot can turn, or on ramps."""
        traversability, paths = context.traversability, context.paths
        assert paths.start is not None
        stands = paths.reachable & (paths.cost > 0) & (traversability.turnable | traversability.ramp)
        cells = np.argwhere(stands[::STRIDE, ::STRIDE]) * STRIDE
        candidates = np.vstack([paths.start, traversability.grid.centre_of(cells)])
        arrival = arrival_headings(candidates, paths, yaw_of(context.T_map_base))
        gains = self._gains(paths.start, cells, camera)
        if self.rewards and self.rewards.wanted:
            gains = gains + self.rewards.gains(traversability.on_ground(candidates), BEARINGS)
        gains = np.where(visibility.possible_bearings(arrival), gains, 0.0)
        distance = np.append(0.0, traversability.grid.at(paths.cost, candidates[1:]))
        worth = self.worth(gains, distance, self._seconds(candidates, distance, context))
        n, m = np.unravel_index(worth.argmax(), worth.shape)
        if worth[n, m] <= 0:
            return None
        turns = bool(np.isnan(arrival[n]))
        backwards = None if turns else False
        return Viewpoint(candidates[n], _heading(m), turns, float(gains[n, m]), backwards)

    def _straight_viewpoint(self, context: Context, camera: kernels.CameraView) -> Viewpoint | None:
        """The best one from where the robot cannot turn, but drives to straight from where it can, or backs up to.

        Only ground that was taken for flat when the robot was set down is sought like this: with its back to the
        wall of a small room the robot sees what is otherwise nearer than the camera sees, and from a ramp that it
        backs up what lies before the ramp.
        """
        traversability, paths = context.traversability, context.paths
        grid, reachable = traversability.grid, paths.reachable
        terrain = self._terrain._replace(target=self._terrain.target & reachable)
        # Where the robot can stand but not turn, and something unseen is in reach.
        narrow = reachable & (paths.cost > 0) & ~traversability.can_turn
        places = grid.centre_of(np.argwhere(narrow & (grid.distance_to(terrain.target) <= camera.reach)))
        half_size = np.array([self._robot.half_length, self._robot.half_width]) + STRAY
        turnable, hazard, rules = traversability.turnable & reachable, traversability.hazard, traversability.rules()
        ways = kernels.straight_ways(
            places, RAYS, LONGEST_STRAIGHT, turnable, half_size, hazard, rules, grid.origin, grid.cell
        )
        # Backwards the robot comes from where it looks.
        ways = np.stack([ways, np.roll(ways, RAYS // 2, axis=1)])
        gains = visibility.gains(kernels.ray_gains(places, camera, terrain), camera)
        seconds = KEYFRAME_TIME + grid.at(paths.cost, places) / self._robot.speed
        worth = np.where(np.isfinite(ways) & (gains >= MIN_GAIN), gains / seconds[:, None], 0.0)
        if not worth.any():
            return None
        b, n, m = np.unravel_index(worth.argmax(), worth.shape)
        heading = _heading(m)
        ahead = np.array([np.cos(heading), np.sin(heading)]) * (-1 if b else 1)
        via = places[n] - ways[b, n, m] * ahead
        return Viewpoint(places[n], heading, False, float(gains[n, m]), bool(b), via)

    def correct(self, correction: Correction) -> None:
        """Let what keyframes missed follow their poses, and what the next one should show that of the newest."""
        moved = [(correction.motion_at(place), place, cells) for place, cells in self._missed]
        self._missed = [(moved_by(T, place[None])[0], moved_by(T, cells)) for T, place, cells in moved]
        self._expected = self._cells_of(moved_by(correction.motions[-1], self._centres_of(self._expected)))
        grid = self._layers.grid
        misses, missed_from = np.zeros(grid.shape, np.uint8), np.full((*grid.shape, 2), np.inf)
        for place, centres in self._missed:
            where = tuple((self._cells_of(centres) - grid.low).T)
            misses[where] += 1
            missed_from[where] = place
        self._layers.write("misses", misses)
        self._layers.write("missed_from", missed_from)

    def _centres_of(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """(N, 2) m, centres of cells (N, 2), absolute indices."""
        return self._layers.grid.centre_of(cells - self._layers.grid.low)

    def _cells_of(self, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """(M, 2) absolute indices of the cells, each once, that hold places (N, 2), m; none beyond the grid."""
        grid = self._layers.grid
        cells = np.unique(grid.cell_of(places), axis=0)
        return grid.low + cells[((cells >= 0) & (cells < grid.shape)).all(axis=1)]

    def _count_misses(self, measured: NDArray[np.float32], position: NDArray[np.float64]) -> None:
        """Remember which cells the last keyframe should have shown and did not."""
        cells = self._expected - self._layers.grid.low
        cells = cells[np.isnan(measured[tuple(cells.T)])]
        missed = tuple(cells.T)
        if len(cells):
            self._missed.append((position.copy(), self._layers.grid.centre_of(cells)))
        self._layers.write("misses", self._layers["misses"][missed] + 1, missed)
        self._layers.write("missed_from", position, missed)
        self._expected = np.zeros((0, 2), np.int64)

    def _write_terrain(self, context: Context) -> None:
        """Write what is known of the ground; unseen ground that may be traversable is a target until given up."""
        layers, misses = self._layers, self._layers["misses"].astype(np.int64)
        may_be_driven = context.traversability.to_hazard >= WALL_MARGIN
        layers.write("elevation", context.traversability.elevation)
        layers.write("gradient", context.traversability.gradient)
        layers.write("target", np.isnan(context.measured) & may_be_driven & (misses < MAX_MISSES))
        layers.write("probability", SHOW_PROBABILITY**misses)

    @property
    def _terrain(self) -> kernels.Terrain:
        """What is known of the ground by the last keyframe."""
        names = ("elevation", "gradient", "target", "probability", "missed_from")
        return kernels.Terrain(self._layers.grid.origin, CELL, *(self._layers[name] for name in names))

    def _gains(
        self, here: NDArray[np.float64], cells: NDArray[np.int64], camera: kernels.CameraView
    ) -> NDArray[np.float64]:
        """(1 + N, RAYS) m² that each viewpoint should show, from here and from the cells (N, 2)."""
        changed, self._revision = self._layers.changed_since(self._revision), self._layers.revision
        around = self._ray_gains.of(cells, camera, self._terrain, changed)
        from_here = kernels.ray_gains(here[None], camera, self._terrain)
        return visibility.gains(np.vstack([from_here, around]), camera)

    def _seconds(
        self, candidates: NDArray[np.float64], distance: NDArray[np.float64], context: Context
    ) -> NDArray[np.float64]:
        """(N, RAYS) time to each viewpoint, the way to whose place costs ``distance`` (N,) m."""
        traversability, yaw = context.traversability, yaw_of(context.T_map_base)
        way = candidates - context.T_map_base[:2, 3]
        moves = distance > _HERE
        first = np.where(moves, np.arctan2(way[:, 1], way[:, 0]), yaw)
        turn = np.abs(wrap_angles(first - yaw))[:, None]
        turn = turn + np.abs(wrap_angles(BEARINGS - first[:, None]))
        slow = np.where(traversability.grid.at(traversability.slidable, candidates), RAMP_TURN, 1.0)
        return KEYFRAME_TIME + distance[:, None] / self._robot.speed + turn * slow[:, None] / TURN_RATE


def arrival_headings(candidates: NDArray[np.float64], paths: ShortestPaths, yaw: float) -> NDArray[np.float64]:
    """(N,) rad, at which the robot arrives at places (N, 2), m, here first, where it cannot turn; NaN where it can.

    -inf where it would have to turn on the way but cannot. ``yaw`` is its heading now.
    """
    can_turn = paths.traversability.can_turn
    ahead = paths.arrival_at(candidates[1:])
    # Without a place to turn on the way it arrives as it stands now, forwards or backwards.
    stays, along = ~paths.pass_by(can_turn, candidates[1:]), np.cos(ahead - yaw)
    ahead = np.where(stays & (along < 0), ahead + np.pi, ahead)
    ahead[stays & (np.abs(along) < _ALONG)] = _NEVER
    return np.where(paths.traversability.grid.at(can_turn, candidates), np.nan, np.append(yaw, ahead))


def _heading(bearing: np.intp) -> float:
    """rad of one of the bearings."""
    return wrap_angle(bearing * 2 * np.pi / RAYS)
