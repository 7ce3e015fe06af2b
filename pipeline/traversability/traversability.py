"""Where the robot may stand, turn and drive."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pipeline.errors import InputError
from pipeline.grid_map import Grid
from pipeline.labels import RAMP_TILT
from pipeline.robot import RobotModel
from pipeline.traversability import elevation_kernels as kernels
from pipeline.traversability import shortest_paths_kernels as path_kernels
from pipeline.traversability.elevation_map import ElevationMap

FAR = 1.0
"""m; hazards further away make no difference to the robot."""
MAX_DROP_GAP = 0.6
"""m; known ground so far apart, with unknown ground between, may be the two sides of a drop."""
RAMP_MARGIN = 0.2
"""m; so near to a ramp the robot's wheels may already be on it."""
RAMP_ALIGNMENT = np.deg2rad(20)
"""rad, largest angle between a drive over a ramp and its slope."""


@dataclass(frozen=True, eq=False)
class Traversability:
    """What follows from an elevation map for the robot; all arrays are (nx, ny) on its grid.

    Attributes:
        grid: where the cells lie.
        elevation: float32 m, NaN where unknown.
        gradient: (nx, ny, 2) float32 slope of the ground along x and y; 0 where unknown.
        hazard: bool, steps and slopes that the robot cannot take.
        to_hazard: float64 m to the nearest hazard, at most :data:`FAR`.
        traversable: bool, the robot's centre may pass.
        turnable: bool, the robot may turn in place, on level ground.
        slidable: bool, on or before a ramp it may turn in place, for there is room to slide.
        room: bool, on or before a ramp it may also drive across the slope.
        ramp: bool, the wheels are on a ramp or just before it.
        uphill: (nx, ny, 2) float32 unit vector up the nearest ramp; 0 away from ramps.
        robot: for which this was judged.
    """

    grid: Grid
    elevation: NDArray[np.float32]
    gradient: NDArray[np.float32]
    hazard: NDArray[np.bool_]
    to_hazard: NDArray[np.float64]
    traversable: NDArray[np.bool_]
    turnable: NDArray[np.bool_]
    slidable: NDArray[np.bool_]
    room: NDArray[np.bool_]
    ramp: NDArray[np.bool_]
    uphill: NDArray[np.float32]
    robot: RobotModel

    @property
    def can_turn(self) -> NDArray[np.bool_]:
        """(nx, ny) where the robot may turn in place, on level ground or on a ramp."""
        return self.turnable | self.slidable

    def lines_are_traversable(self, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.bool_]:
        """(N,) whether the robot can drive the straight lines between points (N or 1, 2 or 3), m, ramps head-on."""
        return path_kernels.lines_are_traversable(*self._lines(starts, ends), self.rules())

    def metres_across(self, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.float64]:
        """(N,) metres that lines between points (N or 1, 2 or 3) lead over ramps otherwise than along their slope."""
        return path_kernels.metres_on(*self._lines(starts, ends), self.traversable, self.rules())

    def metres_on(self, starts: ArrayLike, ends: ArrayLike, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(N,) metres of lines between points (N or 1, 2 or 3) that lie over a mask (nx, ny)."""
        return path_kernels.metres_on(*self._lines(starts, ends), mask)

    def _lines(
        self, starts: ArrayLike, ends: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
        """Both ends (N, 2) of lines, and where the grid lies."""
        a, b = np.broadcast_arrays(*(np.asarray(side, np.float64)[..., :2] for side in (starts, ends)))
        return np.ascontiguousarray(a), np.ascontiguousarray(b), self.grid.origin, self.grid.cell

    def on_ground(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(N, 3) the points of the ground at (N, 2) m."""
        return np.column_stack([np.asarray(xy, np.float64), self.grid.at(self.elevation, xy)])

    def rules(self, ramp_alignment: float = RAMP_ALIGNMENT) -> path_kernels.Rules:
        """Where the robot may go if ramps must be met within ``ramp_alignment`` rad of their slope."""
        return path_kernels.Rules(
            self.traversable, self.ramp, self.room, self.slidable, self.uphill, float(np.cos(ramp_alignment))
        )


def assess_map(elevation_map: ElevationMap) -> Traversability:
    """Judge every cell of an elevation map for its robot."""
    m = elevation_map
    return assess(m.grid, m.elevation, m.dropout, m.driven, m.robot)


def assess(
    grid: Grid,
    elevation: NDArray[np.float32],
    dropout: NDArray[np.bool_],
    driven: NDArray[np.bool_],
    robot: RobotModel,
) -> Traversability:
    """Judge every cell of a grid, beyond which all is unknown.

    The robot keeps its clearances from hazards, from depth dropouts, where a thin panel may stand, and on the level
    from unknown ground as well: a wall that is only met at grazing angles stays unknown. On ramps half of its width
    from the unknown is enough, since what lies behind a crest is seen from nowhere else. So it is, from all of these,
    where its middle has been: no noise of later keyframes shall shut it in.

    Args:
        grid: where the cells lie.
        elevation: (nx, ny) float32 m, NaN where unknown.
        dropout: (nx, ny) where a thin panel may stand.
        driven: (nx, ny) where the middle of the robot has been.
        robot: how large and how able it is.

    Raises:
        InputError: it needs more room than :data:`FAR`.
    """
    cell, straight, turning = grid.cell, robot.straight_clearance, robot.turning_clearance
    widest = np.max((straight + robot.ramp_drift, turning + robot.ramp_slide))
    if not widest <= FAR:
        raise InputError(f"a robot's clearances are at most {FAR:g} m, got {widest:g} m")
    gradient = kernels.gradients(elevation, cell, radius=2)
    slope = np.linalg.norm(gradient, axis=-1)
    steepest = np.tan(robot.max_tilt)
    hazard = kernels.step_hazards(elevation, round(MAX_DROP_GAP / cell), robot.max_step, steepest * cell)
    hazard |= slope > steepest
    to_hazard = np.minimum(grid.distance_to(hazard), FAR)
    # Beyond the grid's border all is unknown.
    to_unknown = ndimage.distance_transform_edt(np.pad(~np.isnan(elevation), 1))[1:-1, 1:-1] * cell
    to_stop = np.minimum(to_hazard, grid.distance_to(dropout))
    ramp, uphill = _ramps(slope, gradient, hazard, cell)
    from_unknown = np.where(ramp, robot.half_width, straight)
    traversable = (to_stop >= straight) & (to_unknown >= from_unknown)
    traversable |= driven & (np.minimum(to_stop, to_unknown) >= robot.driven_clearance)
    # On a ramp the robot keeps off the unknown as well by what it may slide or drift.
    may_slide, may_drift = (to_unknown >= straight + m for m in (robot.ramp_slide, robot.ramp_drift))
    return Traversability(
        grid=grid,
        elevation=elevation,
        gradient=gradient,
        hazard=hazard,
        to_hazard=to_hazard,
        traversable=traversable,
        turnable=traversable & (to_hazard >= turning) & ~ramp,
        slidable=ramp & may_slide & (to_stop >= turning + robot.ramp_slide),
        room=ramp & may_drift & (to_stop >= straight + robot.ramp_drift),
        ramp=ramp,
        uphill=uphill,
        robot=robot,
    )


def _ramps(
    slope: NDArray, gradient: NDArray, hazard: NDArray[np.bool_], cell: float
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """The cells on or near a ramp, and the unit vector up the nearest one."""
    # Opening drops single noisy cells.
    core = ndimage.binary_opening((slope > np.tan(RAMP_TILT)) & ~hazard, np.ones((3, 3)))
    if not core.any():
        return core, np.zeros_like(gradient)
    distance, nearest = ndimage.distance_transform_edt(~core, return_indices=True)
    ramp = distance * cell <= RAMP_MARGIN
    uphill = gradient[tuple(nearest)] / slope[tuple(nearest)][..., None]
    return ramp, np.where(ramp[..., None], uphill, 0).astype(np.float32)
