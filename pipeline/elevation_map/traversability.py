"""Where the robot may stand, turn and drive."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pipeline.elevation_map import elevation_kernels as kernels
from pipeline.elevation_map import pose_kernels
from pipeline.elevation_map.elevation_map import CELL, ElevationMap
from pipeline.errors import InputError
from pipeline.grid_map import Box, Grid
from pipeline.labels import RAMP_TILT
from pipeline.robot import RobotModel

FAR = 1.0
"""m, greatest room that a robot may need."""
MAX_DROP_GAP = 0.6
"""m, greatest width of unknown ground between the two sides of a drop."""
RAMP_MARGIN = pose_kernels.MOST_ROOM
"""m; this close to a ramp, as to an obstacle, the robot minds it: its wheels may already be on it."""
EXPECTED = 0.65
"""Share of its greatest speed that the robot reaches on ramps, where it aligns itself and slips, and of its greatest
turn rate, since it speeds up and brakes; of the turn rate on ramps, for both reasons, the square."""
STRAY = 0.1
"""m, greatest deviation of the robot from its way."""
LEAST_DRIVEN = -pose_kernels.LENIENCY
"""m, least clearance where the middle of the robot has been, so that noise of later keyframes does not shut it in."""
TALL = 0.4
"""m; a hazard that is higher than this above the ground around it hides what is behind it."""
WALL_GAP = 5
"""Cells along each side of a window; for rays, an unseen cell is as high as the highest hazard in its window."""


@dataclass(frozen=True, eq=False)
class Traversability:
    """Where the robot may drive by an elevation map; all arrays are (nx, ny) on the map's grid.

    Attributes:
        grid: where the cells lie.
        elevation: float32 m, NaN where unknown.
        gradient: (nx, ny, 2) float32 slope of the ground along x and y; 0 where unknown.
        hazard: bool, steps and slopes that the robot cannot drive over.
        to_hazard: float64 m to the nearest hazard, at most :func:`reach_of` the robot.
        obstacle, to_obstacle, clearance, least, ramp, uphill: as of :class:`pose_kernels.Terrain`; distances are at
            most :func:`reach_of` the robot, and a thin panel that may stand there is a hazard.
        free: (nx, ny, 2) uint8 bits of the eight headings with which it can stand, and of the turns it can make.
        turnable: bool, where the robot may turn around, on level ground.
        tall: bool, hazards that hide what is behind them, unlike decks and ramps.
        sealed: float32 m, the elevation with small gaps in walls closed, so that no ray slips through.
        robot: for which the ground was assessed.
        is_tight: whether ways need no margin, see :attr:`without_margin`.
    """

    grid: Grid
    elevation: NDArray[np.float32]
    gradient: NDArray[np.float32]
    hazard: NDArray[np.bool_]
    to_hazard: NDArray[np.float64]
    obstacle: NDArray[np.uint8]
    to_obstacle: NDArray[np.float64]
    clearance: NDArray[np.int8]
    least: NDArray[np.int8]
    ramp: NDArray[np.bool_]
    uphill: NDArray[np.float32]
    free: NDArray[np.uint8]
    turnable: NDArray[np.bool_]
    tall: NDArray[np.bool_]
    sealed: NDArray[np.float32]
    robot: RobotModel
    is_tight: bool = False

    @cached_property
    def traversable(self) -> NDArray[np.bool_]:
        """(nx, ny) where the robot may stand with one heading at least."""
        return self.free[..., 0] != 0

    @cached_property
    def without_margin(self) -> "Traversability":
        """The same ground if the footprint keeps off the middle of cells with obstacles, instead of all of each cell.

        The middle is where an obstacle in a cell is expected. A passage two cells wider than the robot is then
        passable wherever it lies on the grid.
        """
        least = np.minimum(self.least, 0)
        free = pose_kernels.free_poses(self.clearance, least)
        turnable = (self.clearance.min(axis=2) >= 0) & ~self.ramp
        return replace(self, least=least, free=free, turnable=turnable, is_tight=True)

    def part(self, box: Box) -> "Traversability":
        """The part in a box of cells, with contiguous arrays."""
        layers: dict[str, Any] = {name: np.ascontiguousarray(getattr(self, name)[box]) for name in LAYERS}
        return replace(self, grid=self.grid.part(box), **layers)

    @property
    def terrain(self) -> pose_kernels.Terrain:
        """The ground as the search over poses needs it."""
        layers = self.obstacle, self.to_obstacle, self.clearance, self.least, self.ramp, self.uphill
        return pose_kernels.Terrain(self.grid.origin, self.grid.cell, *layers)

    def line_seconds(self, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.float64]:
        """(N,) s, costs of straight drives between points (N or 1, 2 or 3), m; inf where an obstacle is met."""
        a, b = np.broadcast_arrays(*(np.asarray(side, np.float64)[..., :2] for side in (starts, ends)))
        a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
        return pose_kernels.lines_seconds(a, b, self.terrain, costs_of(self.robot))

    def has_ramp(self, xy: ArrayLike) -> bool:
        """Whether a ramp lies within ``RAMP_MARGIN`` of a place (2,), m."""
        places = self.grid.centre_of(np.argwhere(self.ramp))
        return bool((np.linalg.norm(places - np.asarray(xy), axis=1) < RAMP_MARGIN).any())

    def on_ground(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(N, 3) the points of the ground at (N, 2) m."""
        return np.column_stack([np.asarray(xy, np.float64), self.grid.at(self.elevation, xy)])


LAYERS = [field.name for field in fields(Traversability) if field.name not in ("grid", "robot", "is_tight")]


def reach_of(robot: RobotModel) -> float:
    """m; obstacles farther away make no difference to the robot.

    Raises:
        InputError: the robot needs more room than :data:`FAR`.
    """
    widest = robot.corner_radius + pose_kernels.MOST_ROOM
    if not widest <= FAR:
        raise InputError(f"a robot's clearances are at most {FAR:g} m, got {widest:g} m")
    return widest + 2 * CELL


def least_clearance(cell: float) -> int:
    """Whole cm, least clearance of the footprint from hazards: half the diagonal of a cell, m, which is as exact."""
    return round(100 * np.hypot(cell, cell) / 2)


def costs_of(robot: RobotModel, caution: float = 1.0) -> pose_kernels.Costs:
    """Costs of moves that allow for ``caution`` times the measured deviations of a robot from its way."""
    return pose_kernels.Costs(
        half_length=robot.half_length,
        half_width=robot.half_width,
        speed=robot.speed,
        ramp_speed=EXPECTED * robot.ramp_speed,
        turn_rate=EXPECTED * robot.turn_rate,
        ramp_turn_rate=EXPECTED**2 * robot.ramp_turn_rate,
        stray=caution * STRAY,
        slide=caution * robot.ramp_slide / np.tan(robot.max_tilt),
        lean=robot.body_height,
        across=1 / np.tan(robot.max_tilt),
    )


def assess_map(elevation_map: ElevationMap) -> Traversability:
    """Assess every cell of an elevation map for its robot."""
    m = elevation_map
    return assess(m.grid, m.elevation, m.dropout, m.driven, m.robot)


def assess(
    grid: Grid,
    elevation: NDArray[np.float32],
    dropout: NDArray[np.bool_],
    driven: NDArray[np.uint16],
    robot: RobotModel,
    within: Box = (slice(None), slice(None)),
) -> Traversability:
    """Assess every cell of a grid, beyond which all is unknown.

    The footprint keeps :func:`least_clearance` from hazards and from depth dropouts, where a thin panel may stand,
    and ``LENIENCY`` less from unknown ground: a wall that is only seen at grazing angles stays unknown.

    Args:
        grid: where the cells lie.
        elevation: (nx, ny) float32 m, NaN where unknown.
        dropout: (nx, ny) where a thin panel may stand.
        driven: (nx, ny) bits of the poses that the robot has had, see :attr:`ElevationMap.driven`.
        robot: its size and abilities.
        within: box of cells outside of which clearances, and the layers derived from them, are not computed.

    Raises:
        InputError: the robot needs too much room, see :func:`reach_of`.
    """
    cell, reach = grid.cell, reach_of(robot)
    gradient = kernels.gradients(elevation, cell, radius=2)
    slope = np.linalg.norm(gradient, axis=-1)
    steepest = np.tan(robot.max_tilt)
    hazard = kernels.step_hazards(elevation, round(MAX_DROP_GAP / cell), robot.max_step, steepest * cell)
    hazard |= slope > steepest
    to_hazard = np.minimum(grid.distance_to(hazard), reach)
    obstacle, to_obstacle = _obstacles(elevation, hazard | dropout, cell, reach)
    ramp, uphill = _ramps(slope, gradient, hazard, cell)
    clearance = _clearances(obstacle, to_obstacle, robot, cell, within)
    least = np.where(driven, round(100 * LEAST_DRIVEN), least_clearance(cell)).astype(np.int8)
    pose_kernels.allow_driven(clearance, driven, least, -round(50 * robot.half_width))
    free = pose_kernels.free_poses(clearance, least)
    return Traversability(
        grid=grid,
        elevation=elevation,
        gradient=gradient,
        hazard=hazard,
        to_hazard=to_hazard,
        obstacle=obstacle,
        to_obstacle=to_obstacle,
        clearance=clearance,
        least=least,
        ramp=ramp,
        uphill=uphill,
        free=free,
        turnable=(clearance.min(axis=2) >= least_clearance(cell)) & ~ramp,
        tall=hazard & (elevation > ndimage.minimum_filter(np.nan_to_num(elevation, nan=np.inf), WALL_GAP) + TALL),
        sealed=_without_gaps(elevation, hazard),
        robot=robot,
    )


def _obstacles(
    elevation: NDArray[np.float32], hazard: NDArray[np.bool_], cell: float, reach: float
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    obstacle = np.where(np.isnan(elevation), pose_kernels.UNKNOWN, 0).astype(np.uint8)
    obstacle[hazard] = pose_kernels.HAZARD
    # Beyond the grid's border all is unknown.
    distance = ndimage.distance_transform_edt(np.pad(obstacle == 0, 1))[1:-1, 1:-1]
    return obstacle, np.minimum(distance * cell, reach)


def _clearances(
    obstacle: NDArray[np.uint8], to_obstacle: NDArray[np.float64], robot: RobotModel, cell: float, within: Box
) -> NDArray[np.int8]:
    rows, columns = (side.indices(n)[:2] for side, n in zip(within, obstacle.shape, strict=True))
    footprint = pose_kernels.footprint_distances(robot.half_length, robot.half_width, cell)
    near = robot.corner_radius + pose_kernels.MOST_ROOM
    return pose_kernels.clearances(obstacle, to_obstacle, footprint, near, rows, columns)


def _without_gaps(elevation: NDArray[np.float32], hazard: NDArray[np.bool_]) -> NDArray[np.float32]:
    high = ndimage.maximum_filter(np.where(hazard, elevation, -np.inf), WALL_GAP)
    return np.where(np.isnan(elevation) & np.isfinite(high), high, elevation).astype(np.float32)


def _ramps(
    slope: NDArray, gradient: NDArray, hazard: NDArray[np.bool_], cell: float
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """The cells on or near a ramp, and the gradient of the nearest one."""
    # Opening drops single noisy cells.
    core = ndimage.binary_opening((slope > np.tan(RAMP_TILT)) & ~hazard, np.ones((3, 3)))
    if not core.any():
        return core, np.zeros_like(gradient)
    distance, nearest = ndimage.distance_transform_edt(~core, return_indices=True)
    ramp = distance * cell <= RAMP_MARGIN
    return ramp, np.where(ramp[..., None], gradient[tuple(nearest)], 0).astype(np.float32)
