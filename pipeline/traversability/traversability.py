"""Where on the surface the robot may stand, turn and drive."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pipeline.errors import InputError
from pipeline.grid_map import Grid
from pipeline.traversability import elevation_kernels as kernels
from pipeline.traversability import shortest_paths_kernels as path_kernels
from pipeline.traversability.elevation_map import ElevationMap

FAR = 1.0
"""m; what is further away makes no difference to the robot."""


@dataclass(frozen=True)
class TraversabilityConfig:
    """What a Pioneer 3-AT takes, with a margin for the noise of the map.

    Attributes:
        max_step: between neighbouring cells, m; the lowest steps of stairs and step fields, 0.05 m, are not for
            driving.
        max_tilt: rad.
        clearance: of the robot's centre from hazards while driving straight, m, and on the level from unknown
            ground: a wall that is only met at grazing angles stays unknown.
        driven_clearance: from hazards and the unknown alike in cells where its centre has been, m; half of its width:
            it has passed what stands beside them, and no noise of later looks shall shut it in.
        ramp_unknown_clearance: from unknown ground on ramps, m; half of the robot's width. What lies behind a crest
            is seen from nowhere else.
        turning_clearance: from hazards while turning in place, m; the corners of the chassis sweep 0.355 m, and
            the robot stands up to 0.04 m beside where it was sent.
        ramp_tilt: a steeper cell belongs to a ramp, rad.
        ramp_margin: so near to a ramp the robot's wheels may already be on it, m.
        ramp_alignment: largest angle between a drive over a ramp and its slope, rad.
        ramp_slide: further away when turning on a ramp, m: in a quarter turn on 16° it strays by up to 0.13,
            measured, although it makes up for sliding.
        ramp_drift: one that crosses a ramp sideways, m: 0.013 in 2 m on 16°, measured.
        max_drop_gap: known ground so far apart, with unknown ground between, may be the two sides of a drop, m.
    """

    max_step: float = 0.04
    max_tilt: float = np.deg2rad(20)
    clearance: float = 0.30
    driven_clearance: float = 0.25
    ramp_unknown_clearance: float = 0.25
    turning_clearance: float = 0.40
    ramp_tilt: float = np.deg2rad(8)
    ramp_margin: float = 0.2
    ramp_alignment: float = np.deg2rad(20)
    ramp_slide: float = 0.15
    ramp_drift: float = 0.05
    max_drop_gap: float = 0.6

    def __post_init__(self) -> None:
        """Refuse distances beyond those that are told apart."""
        reaches = (
            self.clearance + self.ramp_drift,
            self.turning_clearance + self.ramp_slide,
            self.ramp_margin,
        )
        widest = np.max(reaches)
        if not widest <= FAR:
            raise InputError(f"clearances on the surface are at most {FAR:g} m, got {widest:g} m")


@dataclass(frozen=True, eq=False)
class Traversability:
    """What follows from a surface map for the robot; all arrays are (nx, ny) on its grid.

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
        ramp_alignment: rad, as configured.
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
    ramp_alignment: float

    def lines_are_traversable(self, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.bool_]:
        """(N,) whether the robot can drive the straight lines between points (N, 2 or 3), ramps head-on."""
        return path_kernels.lines_are_traversable(
            np.ascontiguousarray(np.asarray(starts, np.float64)[..., :2]),
            np.ascontiguousarray(np.asarray(ends, np.float64)[..., :2]),
            self.grid.origin,
            self.grid.cell,
            self.rules(self.ramp_alignment),
        )

    def metres_across(self, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.float64]:
        """(N,) metres that lines between points (N, 2 or 3) lead over ramps otherwise than along their slope."""
        return path_kernels.metres_across(
            np.ascontiguousarray(np.asarray(starts, np.float64)[..., :2]),
            np.ascontiguousarray(np.asarray(ends, np.float64)[..., :2]),
            self.grid.origin,
            self.grid.cell,
            self.rules(self.ramp_alignment),
        )

    def metres_on(self, starts: ArrayLike, ends: ArrayLike, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(N,) metres of lines between points (N, 2 or 3) that lie over a mask (nx, ny)."""
        return path_kernels.metres_on(
            np.ascontiguousarray(np.asarray(starts, np.float64)[..., :2]),
            np.ascontiguousarray(np.asarray(ends, np.float64)[..., :2]),
            self.grid.origin,
            self.grid.cell,
            mask,
        )

    def on_ground(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(N, 3) the points of the ground at (N, 2) m."""
        return np.column_stack([np.asarray(xy, np.float64), self.grid.at(self.elevation, xy)])

    def rules(self, ramp_alignment: float) -> path_kernels.Rules:
        """Where the robot may go if ramps must be met within ``ramp_alignment`` rad of their slope."""
        return path_kernels.Rules(
            self.traversable, self.ramp, self.room, self.slidable, self.uphill, float(np.cos(ramp_alignment))
        )


def assess_map(elevation_map: ElevationMap, config: TraversabilityConfig | None = None) -> Traversability:
    """Judge every cell of the surface map."""
    return assess(
        elevation_map.grid,
        elevation_map.elevation,
        elevation_map.dropout,
        elevation_map.driven,
        config or TraversabilityConfig(),
    )


def assess(
    grid: Grid,
    elevation: NDArray[np.float32],
    dropout: NDArray[np.bool_],
    driven: NDArray[np.bool_],
    config: TraversabilityConfig,
) -> Traversability:
    """Judge every cell of a grid, beyond which all is unknown.

    Args:
        grid: where the cells lie.
        elevation: (nx, ny) float32 m, NaN where unknown.
        dropout: (nx, ny) where a thin panel may stand.
        driven: (nx, ny) where the middle of the robot has been.
        config: what the robot takes.
    """
    cell = grid.cell
    gradient = kernels.gradients(elevation, cell, radius=2)
    slope = np.linalg.norm(gradient, axis=-1)
    hazard = kernels.step_hazards(elevation, config.max_step) | (slope > np.tan(config.max_tilt))
    steepest = np.tan(config.max_tilt) * cell
    hazard |= kernels.drops(elevation, round(config.max_drop_gap / cell), config.max_step, steepest)
    to_hazard = np.minimum(grid.distance_to(hazard), FAR)
    # Beyond the grid's border all is unknown.
    to_unknown = ndimage.distance_transform_edt(np.pad(~np.isnan(elevation), 1))[1:-1, 1:-1] * cell
    to_stop = np.minimum(to_hazard, grid.distance_to(dropout))
    ramp, uphill = _ramps(slope, gradient, hazard, cell, config)
    from_unknown = np.where(ramp, config.ramp_unknown_clearance, config.clearance)
    traversable = (to_stop >= config.clearance) & (to_unknown >= from_unknown)
    traversable |= driven & (np.minimum(to_stop, to_unknown) >= config.driven_clearance)
    # On a ramp the robot keeps off the unknown as well by what it may slide or drift.
    may_slide, may_drift = (
        to_unknown >= config.clearance + m for m in (config.ramp_slide, config.ramp_drift)
    )
    return Traversability(
        grid=grid,
        elevation=elevation,
        gradient=gradient,
        hazard=hazard,
        to_hazard=to_hazard,
        traversable=traversable,
        turnable=traversable & (to_hazard >= config.turning_clearance) & ~ramp,
        slidable=ramp & may_slide & (to_stop >= config.turning_clearance + config.ramp_slide),
        room=ramp & may_drift & (to_stop >= config.clearance + config.ramp_drift),
        ramp=ramp,
        uphill=uphill,
        ramp_alignment=config.ramp_alignment,
    )


def _ramps(
    slope: NDArray, gradient: NDArray, hazard: NDArray[np.bool_], cell: float, config: TraversabilityConfig
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """The cells on or near a ramp, and the unit vector up the nearest one."""
    # Opening drops single noisy cells.
    core = ndimage.binary_opening((slope > np.tan(config.ramp_tilt)) & ~hazard, np.ones((3, 3)))
    if not core.any():
        return core, np.zeros_like(gradient)
    distance, nearest = ndimage.distance_transform_edt(~core, return_indices=True)
    ramp = distance * cell <= config.ramp_margin
    uphill = gradient[tuple(nearest)] / slope[tuple(nearest)][..., None]
    return ramp, np.where(ramp[..., None], uphill, 0).astype(np.float32)
