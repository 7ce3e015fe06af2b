"""Where the robot may stand, turn and drive."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pipeline.arrays import Layer, MaskLayer, Place, Places, Pose, Values
from pipeline.elevation_map import elevation_kernels as kernels
from pipeline.elevation_map import pose_kernels
from pipeline.elevation_map.config import TraversabilityConfig
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.errors import InputError
from pipeline.grid_map import CellWindow, Grid, box_around, relative_to
from pipeline.labels import RAMP_TILT
from pipeline.robot import RobotModel
from pipeline.transforms import from_rotation

MAX_REACH = 1.0
"""Maximum distance from the robot's centre for which clearances fit into int8 cm, m."""
SLOPE_RADIUS = 3
"""Radius of the neighbourhood over which the slope of a cell is fitted, cells: about half the distance between a
robot's axles, because a small step tilts the robot over this distance."""
SURFACE_SLOPE, SURFACE_RISE = 0.8, 0.02
"""Slope, m per m, and rise, m. A neighbour whose height differs by more than the slope times its distance plus the
rise is left out of the fit. It belongs to another surface, such as a wall or the floor under a deck. The same applies
to neighbours behind such a step, such as the top of a low block beside the cell."""
WIDEST_HEIGHT_FRACTION = 0.5
"""Height at which a robot's body is widest, as a fraction of the body's height; tyres bulge there, and the top plate
is narrower."""
TURN_ALLOWANCE = 1
"""Distance by which a turn to the next heading may come closer to an obstacle than the footprint at a pose may,
cm."""
MIN_DRIVEN_CLEARANCE = -0.03
"""Minimum clearance required where the robot's centre has been, m.

This clearance is also assumed to exist there, so that noise in later keyframes does not trap the robot.
"""
MAX_INTRUSION_FRACTION = 0.5
"""Maximum depth of an obstacle in the footprint that drift of the map can explain, as a fraction of half the robot's
width.

An obstacle farther inside the footprint blocks the robot even where it has been.
"""
WALL_WINDOW = 5
"""Side of the window around a cell, cells, in which neighbouring hazards and ground are searched for.

For rays, an unknown cell is as high as the highest hazard in the window.
"""
TICK = 0.01
"""Resolution of costs in the search, s."""


@dataclass(frozen=True, eq=False)
class Traversability:
    """An elevation map's ground, assessed for driving; all arrays are (nx, ny) on the map's grid.

    Attributes:
        grid: the map's grid.
        elevation: float32 m, NaN where unknown.
        gradient: (nx, ny, 2) float32 slope of the ground along x and y; 0 where unknown.
        hazard: steps and slopes that the robot cannot drive over.
        to_hazard: distance to the nearest hazard, at most :func:`reach_of` the robot, m.
        level_clearance: clearance without room downhill on slopes, see :attr:`without_downhill_room`.
        obstacle, to_obstacle, clearance, required_clearance, ramp, uphill: see :class:`pose_kernels.Terrain`;
            distances are at most :func:`reach_of` the robot, and a cell where a thin panel may stand is a hazard.
        free: (nx, ny, 2) uint8 bits of the eight headings with which the robot can stand, and of the possible turns.
        turnable: where the robot can turn through a full circle on level ground.
        tall: hazards that hide the ground behind them, unlike decks and ramps.
        kept_off: ground next to people, from which the robot keeps away; it is treated as a hazard.
        beside_people: ground around people, on which the robot drives no faster than ``speed_near_people``.
        sealed: float32 elevation with small gaps in walls closed, so that no ray slips through, m.
        robot, config: the robot and the settings used for the assessment.
        speed_near_people: maximum speed near people, m/s.
        ignores_margin: whether paths need no margin, see :attr:`without_margin`.
        ignores_downhill_room: whether paths need no room downhill, see :attr:`without_downhill_room`.
    """

    grid: Grid
    elevation: Layer
    gradient: Layer
    hazard: MaskLayer
    to_hazard: Layer
    obstacle: NDArray[np.uint8]
    to_obstacle: Layer
    level_clearance: NDArray[np.int8]
    clearance: NDArray[np.int8]
    required_clearance: NDArray[np.int8]
    ramp: MaskLayer
    uphill: Layer
    free: NDArray[np.uint8]
    turnable: MaskLayer
    tall: MaskLayer
    kept_off: MaskLayer
    beside_people: MaskLayer
    sealed: Layer
    robot: RobotModel
    config: TraversabilityConfig
    speed_near_people: float = np.inf
    ignores_margin: bool = False
    ignores_downhill_room: bool = False

    @cached_property
    def traversable(self) -> MaskLayer:
        """Where the robot may stand with at least one heading."""
        return self.free[..., 0] != 0

    @cached_property
    def without_margin(self) -> "Traversability":
        """The same ground if the footprint must avoid only the centres of cells with obstacles, not whole cells.

        The centre is where the obstacle is expected. A passage two cells wider than the robot is then passable,
        wherever it lies on the grid.
        """
        required_clearance = np.minimum(self.required_clearance, 0)
        free = pose_kernels.free_poses(self.clearance, required_clearance, TURN_ALLOWANCE)
        turnable = (self.clearance.min(axis=2) >= 0) & ~self.ramp
        return replace(self, required_clearance=required_clearance, free=free, turnable=turnable, ignores_margin=True)

    @cached_property
    def without_downhill_room(self) -> "Traversability":
        """The same ground without room downhill on slopes, a risk that is taken only if no other path exists.

        Poses without this room have no more clearance than they need, so paths that avoid them remain cheaper.
        """
        clearance = _without_downhill_room(self.clearance, self.level_clearance, self.required_clearance)
        free = pose_kernels.free_poses(clearance, self.required_clearance, TURN_ALLOWANCE)
        return replace(self, clearance=clearance, free=free, ignores_downhill_room=True)

    def keeping_off(
        self,
        people: NDArray[np.floating],
        been: MaskLayer,
        beside_people: float = 0.0,
        speed_near_people: float = np.inf,
    ) -> "Traversability":
        """The same ground if everything within ``keep_off`` of people is a hazard, except where the robot has been.

        A hand on the floor is too low to be recognised as a step, and a robot that finds a person next to it must be
        able to leave.

        Args:
            people: (N, 2 or 3) points on people, m.
            been: (nx, ny) cells where the robot has been.
            beside_people: distance from people within which the robot drives no faster than ``speed_near_people``, m.
            speed_near_people: maximum speed near people, m/s.
        """
        to_people = self.grid.distance_to(self.grid.mask_of(people))
        limited = replace(self, beside_people=to_people <= beside_people, speed_near_people=speed_near_people)
        kept_off = (to_people <= self.config.keep_off) & ~been & ~self.hazard
        if not kept_off.any():
            return limited
        cell, reach = self.grid.cell, reach_of(self.robot, self.config, self.grid.cell)
        hazard = self.hazard | kept_off
        # Clearances from this ground alone, because those from other obstacles are larger where the robot has driven
        alone, distance = np.where(kept_off, pose_kernels.HAZARD, 0).astype(np.uint8), self.grid.distance_to(kept_off)
        box = box_around(kept_off, ceil(reach / cell))
        level = _clearances(alone, distance, self.robot, cell, self.config, box)
        clearance = np.minimum(self.clearance, _on_slopes(level, self.uphill, self.robot, cell))
        level = np.minimum(self.level_clearance, level)
        return replace(
            limited,
            hazard=hazard,
            to_hazard=np.minimum(self.grid.distance_to(hazard), reach),
            obstacle=np.maximum(self.obstacle, alone),
            to_obstacle=np.minimum(self.to_obstacle, distance),
            level_clearance=level,
            clearance=clearance,
            free=pose_kernels.free_poses(clearance, self.required_clearance, TURN_ALLOWANCE),
            turnable=self.turnable & (clearance.min(axis=2) >= min_clearance(cell)),
            kept_off=kept_off,
        )

    def with_unseen_free(
        self, places: NDArray[np.float64], margin: float, shut: NDArray[np.float64], doubts: bool = True
    ) -> "Traversability":
        """The same ground if all unknown ground is free and level, on a larger grid.

        Args:
            places: (N, 2) positions that the grid must contain, m.
            margin: distance around each of these positions that the grid must contain, too, m.
            shut: (M, 2) positions of unknown ground that nevertheless is not free, m.
            doubts: whether depth dropouts, where a thin panel may stand, are not free.
        """
        grid = self.grid.widened(places, margin)
        box = grid.box_of(self.grid)
        known: dict[str, Any] = {
            name: _enlarged(getattr(self, name), grid, box, UNSEEN_VALUES.get(name, 0)) for name in LAYERS
        }
        hazard = (known["obstacle"] == pose_kernels.HAZARD if doubts else known["hazard"]) | grid.mask_of(shut)
        distance = np.minimum(grid.distance_to(hazard), reach_of(self.robot, self.config, grid.cell))
        obstacle = np.where(hazard, pose_kernels.HAZARD, 0).astype(np.uint8)
        everywhere = slice(None), slice(None)
        level = _clearances(obstacle, distance, self.robot, grid.cell, self.config, everywhere)
        clearance = _on_slopes(level, known["uphill"], self.robot, grid.cell)
        # Where the robot has driven, the clearance is larger.
        level, clearance = np.maximum(level, known["level_clearance"]), np.maximum(clearance, known["clearance"])
        required_clearance = known["required_clearance"]
        required_clearance[np.isnan(known["elevation"])] = 0 if self.ignores_margin else min_clearance(grid.cell)
        if self.ignores_downhill_room:
            clearance = _without_downhill_room(clearance, level, required_clearance)
        known |= {
            "obstacle": obstacle,
            "to_obstacle": distance,
            "level_clearance": level,
            "clearance": clearance,
            "required_clearance": required_clearance,
        }
        known["free"] = pose_kernels.free_poses(clearance, required_clearance, TURN_ALLOWANCE)
        return replace(self, grid=grid, **known)

    def part(self, box: CellWindow) -> "Traversability":
        """The part in a box of cells, with contiguous arrays."""
        layers: dict[str, Any] = {name: np.ascontiguousarray(getattr(self, name)[box]) for name in LAYERS}
        return replace(self, grid=self.grid.part(box), **layers)

    @property
    def terrain(self) -> pose_kernels.Terrain:
        """The ground in the form required by the search over poses."""
        return pose_kernels.Terrain(
            self.grid.origin,
            self.grid.cell,
            self.config.leniency,
            TURN_ALLOWANCE,
            self.obstacle,
            self.to_obstacle,
            self.clearance,
            self.required_clearance,
            self.ramp,
            self.uphill,
            self.beside_people,
        )

    def costs(self, caution: float = 1.0) -> pose_kernels.Costs:
        """Costs of moves that allow for ``caution`` times the measured deviations of the robot from its path.

        With ``caution`` 0, they are the expected durations of the moves, with backward drives counted ``backing``
        times.
        """
        robot, costs = self.robot, self.config.costs
        drives = costs.ramp_pace if caution else costs.expected_ramp_pace
        turns = costs.ramp_pace * costs.turn_pace if caution else costs.expected_ramp_pace
        return pose_kernels.Costs(
            half_length=robot.half_length,
            half_width=robot.half_width,
            speed=robot.speed,
            ramp_speed=drives * robot.ramp_speed,
            speed_near_people=float(self.speed_near_people),
            turn_rate=costs.turn_pace * robot.turn_rate,
            ramp_turn_rate=turns * robot.ramp_turn_rate,
            max_deviation=caution * costs.max_path_deviation,
            slope_deviation=caution * slide_of(robot),
            slide=0.0 if self.ignores_downhill_room else slide_of(robot),
            lean=0.0 if self.ignores_downhill_room else WIDEST_HEIGHT_FRACTION * robot.body_height,
            cross_slope_factor=1 / np.tan(robot.max_tilt),
            full_speed_clearance=costs.full_speed_clearance,
            narrow_speed=float(np.sqrt(2 * robot.acceleration * costs.narrow_stopping_distance)),
            backing=costs.backing,
            collision_penalty=costs.collision_penalty,
            bend=costs.bend,
            tick=TICK,
        )

    def line_seconds(self, starts: ArrayLike, ends: ArrayLike) -> Values:
        """(N,) s, costs of straight drives between points (N or 1, 2 or 3), m; inf if an obstacle is in the way."""
        a, b = np.broadcast_arrays(*(np.asarray(side, np.float64)[..., :2] for side in (starts, ends)))
        a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
        return pose_kernels.lines_seconds(a, b, self.terrain, self.costs())

    def pose_clearances(self, poses: Places) -> Values:
        """(N,) m, room around the robot's footprint at poses (N, 3); negative where it cannot stand.

        See :func:`pose_kernels.pose_clearances`.
        """
        return pose_kernels.pose_clearances(np.ascontiguousarray(poses, np.float64), self.terrain, self.costs())

    def has_ramp(self, xy: ArrayLike) -> bool:
        """Whether the robot drives at a position (2,), m, as on a ramp."""
        return bool(self.grid.at(self.ramp, xy, outside=False))

    def on_ground(self, xy: ArrayLike) -> Places:
        """(N, 3) points on the ground at positions (N, 2), m."""
        return np.column_stack([np.asarray(xy, np.float64), self.grid.at(self.elevation, xy)])

    def pose_on_ground(self, position: Place, heading: float) -> Pose:
        """``T_map_base`` of a robot that stands on the ground at a position (2,), m, with a heading, rad."""
        slope, direction = self.grid.at(self.gradient, position[None])[0], (np.cos(heading), np.sin(heading))
        up, ahead = np.append(-slope, 1.0), np.append(direction, slope @ direction)
        up, ahead = up / np.linalg.norm(up), ahead / np.linalg.norm(ahead)
        return from_rotation(np.column_stack([ahead, np.cross(up, ahead), up]), self.on_ground(position[None])[0])


UNSEEN_VALUES: dict[str, float] = {
    "elevation": np.nan,
    "sealed": np.nan,
    "to_hazard": np.inf,
    "level_clearance": np.iinfo(np.int8).min,
    "clearance": np.iinfo(np.int8).min,
}
"""Values of layers beyond the map, if not 0."""
NO_LAYERS = "grid", "robot", "config", "speed_near_people", "ignores_margin", "ignores_downhill_room"
LAYERS = [field.name for field in fields(Traversability) if field.name not in NO_LAYERS]


def reach_of(robot: RobotModel, config: TraversabilityConfig, cell: float) -> float:
    """Distance, m, beyond which obstacles make no difference to the robot on a grid of ``cell`` m.

    Raises:
        InputError: the robot's corner radius plus ``full_speed_clearance`` is more than ``MAX_REACH``.
    """
    widest = robot.corner_radius + config.costs.full_speed_clearance
    if not widest <= MAX_REACH:
        raise InputError(
            f"the robot's corner radius ({robot.corner_radius:g} m) plus full_speed_clearance "
            f"({config.costs.full_speed_clearance:g} m) must be at most {MAX_REACH:g} m; use a smaller robot or "
            "reduce full_speed_clearance"
        )
    return widest + 2 * cell


def slide_of(robot: RobotModel) -> float:
    """Distance by which a robot slides downhill in a quarter turn, m per unit of slope."""
    return float(robot.ramp_slide / np.tan(robot.max_tilt))


def min_clearance(cell: float) -> int:
    """Minimum clearance of the footprint from hazards, whole cm: half the diagonal of a cell of ``cell`` m.

    The positions of hazards are not known more accurately than this.
    """
    return round(100 * np.hypot(cell, cell) / 2)


def assess_map(elevation_map: ElevationMap) -> Traversability:
    """Assess every cell of an elevation map for its robot."""
    m = elevation_map
    return assess(m.grid, m.elevation, m.dropout, m.driven, m.robot, m.config.traversability)


def _without_downhill_room(
    clearance: NDArray[np.int8], level: NDArray[np.int8], required_clearance: NDArray[np.int8]
) -> NDArray[np.int8]:
    """(nx, ny, 16) ``clearance``, raised to the required one where the footprint's own clearance ``level`` allows."""
    return np.maximum(clearance, np.minimum(level, required_clearance[..., None]))


def assess(
    grid: Grid,
    elevation: Layer,
    dropout: MaskLayer,
    driven: NDArray[np.uint16],
    robot: RobotModel,
    config: TraversabilityConfig,
    within: CellWindow = (slice(None), slice(None)),
) -> Traversability:
    """Assess every cell of a grid, beyond which everything is unknown.

    The footprint keeps :func:`min_clearance` from hazards and from depth dropouts, where a thin panel may stand,
    and slightly less from unknown ground, which may be a wall that is seen only at grazing angles.

    Args:
        grid: the grid of the layers.
        elevation: (nx, ny) float32 m, NaN where unknown.
        dropout: where a thin panel may stand.
        driven: (nx, ny) bits of the poses that the robot has had, see :attr:`ElevationMap.driven`.
        robot: the robot's size and abilities.
        config: settings of the assessment.
        within: box of cells outside which clearances, and the layers derived from them, are not computed.

    Raises:
        InputError: the robot needs too much room, see :func:`reach_of`.
    """
    cell, reach = grid.cell, reach_of(robot, config, grid.cell)
    gradient = kernels.gradients(elevation, cell, SLOPE_RADIUS, SURFACE_SLOPE, SURFACE_RISE)
    slope, steepest = np.linalg.norm(gradient, axis=-1), np.tan(robot.max_tilt)
    hazard = kernels.step_hazards(elevation, round(config.drop_gap / cell), robot.max_step, steepest * cell)
    hazard |= slope > steepest
    to_hazard = np.minimum(grid.distance_to(hazard), reach)
    obstacle, to_obstacle = _obstacles(elevation, hazard | dropout, cell, reach)
    ramp, uphill = _ramps(slope, gradient, hazard, cell, config)
    level = _clearances(obstacle, to_obstacle, robot, cell, config, within)
    clearance = _on_slopes(level, uphill, robot, cell)
    required_clearance = np.where(driven, round(100 * MIN_DRIVEN_CLEARANCE), min_clearance(cell)).astype(np.int8)
    deepest = -round(100 * MAX_INTRUSION_FRACTION * robot.half_width)
    pose_kernels.allow_driven(clearance, level, driven, required_clearance, deepest)
    pose_kernels.allow_driven(level, level, driven, required_clearance, deepest)
    free = pose_kernels.free_poses(clearance, required_clearance, TURN_ALLOWANCE)
    return Traversability(
        grid=grid,
        elevation=elevation,
        gradient=gradient,
        hazard=hazard,
        to_hazard=to_hazard,
        obstacle=obstacle,
        to_obstacle=to_obstacle,
        level_clearance=level,
        clearance=clearance,
        required_clearance=required_clearance,
        ramp=ramp,
        uphill=uphill,
        free=free,
        turnable=(clearance.min(axis=2) >= min_clearance(cell)) & ~ramp,
        tall=_tall(elevation, hazard, config),
        kept_off=np.zeros(grid.shape, np.bool_),
        beside_people=np.zeros(grid.shape, np.bool_),
        sealed=_without_gaps(elevation, hazard),
        robot=robot,
        config=config,
    )


def _enlarged(layer: NDArray[Any], grid: Grid, box: CellWindow, fill: float) -> NDArray[Any]:
    """A layer placed in a box of a larger grid, with ``fill`` elsewhere."""
    spread = np.full((*grid.shape, *layer.shape[2:]), fill, layer.dtype)
    spread[box] = layer
    return spread


def _obstacles(elevation: Layer, hazard: MaskLayer, cell: float, reach: float) -> tuple[NDArray[np.uint8], Layer]:
    """The kind of obstacle in each cell, and the distance to the nearest obstacle, at most ``reach``, m."""
    obstacle = np.where(np.isnan(elevation), pose_kernels.UNKNOWN, 0).astype(np.uint8)
    obstacle[hazard] = pose_kernels.HAZARD
    # Everything beyond the grid is unknown.
    distance = ndimage.distance_transform_edt(np.pad(obstacle == 0, 1))[1:-1, 1:-1]
    return obstacle, np.minimum(distance * cell, reach)


def _clearances(
    obstacle: NDArray[np.uint8],
    to_obstacle: Layer,
    robot: RobotModel,
    cell: float,
    config: TraversabilityConfig,
    within: CellWindow,
) -> NDArray[np.int8]:
    """Clearances as on level ground, in a box of cells and as far outside it as a robot in the box may slide."""
    farthest = ceil(_farthest_downhill(robot) / cell)
    sides = (side.indices(n)[:2] for side, n in zip(within, obstacle.shape, strict=True))
    rows, columns = (
        (max(0, first - farthest), min(n, last + farthest))
        for (first, last), n in zip(sides, obstacle.shape, strict=True)
    )
    full_speed_clearance = config.costs.full_speed_clearance
    footprint = pose_kernels.footprint_distances(robot.half_length, robot.half_width, cell, full_speed_clearance)
    near = robot.corner_radius + full_speed_clearance
    return pose_kernels.clearances(
        obstacle, to_obstacle, footprint, near, rows, columns, full_speed_clearance, config.leniency
    )


def _on_slopes(level: NDArray[np.int8], uphill: Layer, robot: RobotModel, cell: float) -> NDArray[np.int8]:
    """Clearances with room downhill on slopes, computed from ``level``, the clearances as on level ground."""
    return pose_kernels.allow_for_slopes(
        level, uphill, WIDEST_HEIGHT_FRACTION * robot.body_height / cell, slide_of(robot) / cell
    )


def _farthest_downhill(robot: RobotModel) -> float:
    """Maximum distance by which a robot may lean and slide downhill, m."""
    return float(WIDEST_HEIGHT_FRACTION * robot.body_height * np.tan(robot.max_tilt) + robot.ramp_slide)


def _tall(elevation: Layer, hazard: MaskLayer, config: TraversabilityConfig) -> MaskLayer:
    """The hazards that are higher than ``min_tall_height`` above the lowest ground in the window around them."""
    floor = ndimage.minimum_filter(np.nan_to_num(elevation, nan=np.inf), WALL_WINDOW)
    return hazard & (elevation > floor + config.min_tall_height)


def _without_gaps(elevation: Layer, hazard: MaskLayer) -> Layer:
    """The elevation, with unknown cells as high as the highest hazard in the window around them."""
    high = ndimage.maximum_filter(np.where(hazard, elevation, -np.inf), WALL_WINDOW)
    return np.where(np.isnan(elevation) & np.isfinite(high), high, elevation).astype(np.float32)


def _ramps(
    slope: Layer, gradient: Layer, hazard: MaskLayer, cell: float, config: TraversabilityConfig
) -> tuple[MaskLayer, Layer]:
    """The cells on or near a ramp, and the gradient of the nearest one."""
    # Opening removes single noisy cells.
    core = ndimage.binary_opening((slope > np.tan(RAMP_TILT)) & ~hazard, np.ones((3, 3)))
    if not core.any():
        return core, np.zeros_like(gradient)
    distance, nearest = ndimage.distance_transform_edt(~core, return_indices=True)
    ramp = distance * cell <= config.ramp_margin
    return ramp, np.where(ramp[..., None], gradient[tuple(nearest)], 0).astype(np.float32)


class TraversabilityLayer:
    """Assesses one elevation map repeatedly, each time only around the cells that changed."""

    def __init__(self) -> None:
        self._last: Traversability | None = None
        self._revision = 0

    def update(self, elevation_map: ElevationMap) -> Traversability:
        """The result that ``assess_map`` would return for the map; earlier results do not change."""
        source, last = elevation_map.layers, self._last
        changed = source.changed_since(self._revision, "elevation", "dropout", "driven")
        self._revision = source.revision
        if last is None or not last.grid.is_same(source.grid):
            # A hazard at the old border affects the cells that the grid has gained.
            last = assess_map(elevation_map)
        elif changed.any():
            last = _assessed_around(changed, elevation_map, last)
        self._last = last
        return last


def _assessed_around(changed: MaskLayer, elevation_map: ElevationMap, last: Traversability) -> Traversability:
    # A cell affects hazards across a gap and the slopes around it, and a hazard affects the cells within its reach,
    # including cells from which the robot leans or slides that far. A ramp affects the cells within its margin.
    cell, config = last.grid.cell, last.config
    robot = last.robot
    reach = max(reach_of(robot, config, cell) + _farthest_downhill(robot), config.ramp_margin) + config.drop_gap
    reach = round(reach / cell) + 2 * SLOPE_RADIUS + 1
    here, around = box_around(changed, reach), box_around(changed, 2 * reach)
    # The kernels are compiled for contiguous arrays.
    elevation = np.ascontiguousarray(elevation_map.elevation[around])
    dropout, driven = elevation_map.dropout[around], elevation_map.driven[around]
    within = relative_to(here, around)
    part = assess(last.grid.part(around), elevation, dropout, driven, robot, config, within)
    layers = {name: getattr(last, name).copy() for name in LAYERS}
    for name, layer in layers.items():
        layer[here] = getattr(part, name)[within]
    return replace(last, **layers)
