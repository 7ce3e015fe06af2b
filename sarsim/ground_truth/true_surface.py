"""The true ground: where a robot can stand and drive, given its dimensions and abilities."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Layer
from pipeline.errors import InputError
from pipeline.grid_map import Grid
from pipeline.labels import Label
from pipeline.robot import RobotModel
from sarsim.ground_truth import columns_kernels as kernels
from sarsim.ground_truth.columns import ConvexBodies, columns, convex_bodies
from sarsim.ground_truth.contacts import OBSTACLES
from sarsim.robots.skid_steered import robot_model

CELL = 0.05  # m, side of a grid cell
MARGIN = 0.5  # m of grid around the arena
MAX_AREA = 6000.0  # m², maximum area of an arena; one from a .raf file may be 72 m long and wide
PERSON_CLEARANCE = 0.45
"""m, minimum distance of the robot's centre from a person or doll, so that ground behind one is not drivable."""
START_REACH = 0.3  # m; a start at most this far above or below the ground is considered to be on it


@dataclass(frozen=True, eq=False)
class GroundTruthSurface:
    """The true ground on a grid of 5 cm cells; layers are (nx, ny).

    Attributes:
        grid: grid of the layers.
        height: float64 m, height of the ground; NaN where no ground is connected to the start by low steps.
        drivable: bool, whether the cell's ground is connected to the start and has headroom for the robot. Within
            :func:`clearance_of` the robot, there must be no step, wall, clutter or victim, and no tilt beyond the
            robot's maximum. Unless the start is within ``PERSON_CLEARANCE`` of a victim, there must also be no victim
            within this distance. A step is a height difference above twice the robot's ``max_step``.
        walls: bool, whether a wall is in the cell at the height of the robot's body.
    """

    grid: Grid
    height: NDArray[np.float64]
    drivable: NDArray[np.bool_]
    walls: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FreeGround:
    """Ground connected by steps of at most twice the robot's ``max_step``; layers are (nx, ny).

    Attributes:
        grid: grid of the layers.
        height: float64 m, height of the ground; NaN where this ground does not reach.
        label: uint8, label of the ground.
        pieces: int32, the number of the connected drivable piece; 0 where the robot cannot stand.
        obstacle_distance: float64 m, distance to the nearest obstructing wall, clutter or victim; inf only beyond the
            robot's clearance.
        walls: bool, whether a wall is in the cell at the height of the robot's body.
    """

    grid: Grid
    height: NDArray[np.float64]
    label: NDArray[np.uint8]
    pieces: NDArray[np.int32]
    obstacle_distance: Layer
    walls: NDArray[np.bool_]


class Survey:
    """The arena's columns on a grid, which can be searched for connected ground.

    Attributes:
        bodies: the convex bodies of the arena.
        grid: grid of the columns.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        robot_body: int | None = None,
        robot: RobotModel | None = None,
    ):
        """Survey the ground for a robot.

        Args:
            model, data: the arena.
            robot_body: id of the robot's root body, which is left out; None if there is no robot.
            robot: the robot's dimensions and abilities; by default the P3-AT's, for which arenas are built.
        """
        self._robot = robot or robot_model()
        self._clearance = clearance_of(self._robot)
        self._max_step = 2 * self._robot.max_step
        self.bodies = convex_bodies(model, data, robot_body)
        self.grid = _grid_around(self.bodies)
        self._columns = columns(self.bodies, self.grid)
        self._is_obstacle = np.isin(self.bodies.label, OBSTACLES)

    def ground_height_near(self, start: NDArray[np.float64], reach: float = START_REACH) -> float | None:
        """Height, m, of the ground with headroom nearest to a point (3,) m; None if it is not within ``reach`` m."""
        body = self._nearest_top(start, reach)
        return None if body is None else float(self._columns.top[body])

    def grounds(self, label: Label, min_area: float) -> Iterator[FreeGround]:
        """Yield the ground connected to each patch of a label above ``min_area`` m², the largest patch first."""
        height = self._lowest_heights(label)
        unseen = ~np.isnan(height)
        patches, _ = ndimage.label(unseen, np.ones((3, 3)))
        sizes = np.bincount(patches.ravel())[1:] * CELL**2
        for patch in 1 + np.argsort(-sizes, kind="stable")[: np.count_nonzero(sizes > min_area)]:
            cells = unseen & (patches == patch)
            while cells.sum() * CELL**2 > min_area:
                i, j = np.unravel_index(cells.argmax(), cells.shape)
                cells[i, j] = False
                ground = self.ground_from(np.array([*self.grid.centre_of((i, j)), height[i, j]]))
                if ground is not None:
                    yield ground
                    unseen &= np.isnan(ground.height)
                    cells &= unseen

    def _lowest_heights(self, label: Label) -> Layer:
        """(nx, ny) m, height of the lowest top with headroom and this label in each cell; NaN if there is none."""
        c, height = self._columns, np.full(self.grid.shape, np.nan)
        chosen = self.bodies.label == label
        kernels.write_lowest_tops(c.start, c.count, c.bottom, c.top, c.owner, chosen, self._robot.headroom, height)
        return height

    def ground_from(self, start: NDArray[np.float64]) -> FreeGround | None:
        """The ground connected to ``start`` (3,), m; None if there is no ground at ``start``."""
        body = self._nearest_top(start, START_REACH)
        if body is None:
            return None
        height, edge = self._flood(self.grid.cell_of(start), body)
        known = ~np.isnan(height)
        hazard = known & (edge | (_tilt(height) > self._robot.max_tilt))
        clear = self.grid.distance_to(hazard) > self._clearance
        obstacle_distance = self._obstacle_distance(height, self._is_obstacle)
        pieces, _ = ndimage.label(known & clear & (obstacle_distance > self._clearance), np.ones((3, 3)))
        walls = self._obstacle_distance(height, self.bodies.label == Label.WALL) < CELL / 2 - 1e-6
        return FreeGround(self.grid, height, self._label(height), pieces, obstacle_distance, walls)

    def surface_from(self, start: NDArray[np.float64]) -> GroundTruthSurface:
        """The surface around a robot at ``start`` (3,) m; InputError if the robot cannot stand there."""
        ground, (x, y) = self.ground_from(start), np.round(start[:2], 2) + 0.0  # without -0
        if ground is None:
            raise InputError(
                f"there is no free ground at ({x:g}, {y:g}) m; choose another start with --start X Y YAW"
            )
        here = tuple(ground.grid.cell_of(start))
        if not ground.pieces[here]:
            raise InputError(f"the robot cannot stand at ({x:g}, {y:g}) m; choose another start with --start X Y YAW")
        drivable = ground.pieces == ground.pieces[here]
        off_people = drivable & (self._people_distance(ground.height) > PERSON_CLEARANCE)
        if off_people[here]:
            pieces, _ = ndimage.label(off_people, np.ones((3, 3)))
            drivable = pieces == pieces[here]
        return GroundTruthSurface(ground.grid, ground.height, drivable, ground.walls)

    def _people_distance(self, height: NDArray[np.float64]) -> Layer:
        """(nx, ny) m, distance to people and dolls at the robot's height; inf only beyond ``PERSON_CLEARANCE``."""
        return self._obstacle_distance(height, self.bodies.label == Label.VICTIM, PERSON_CLEARANCE, 0.0)

    def _nearest_top(self, start: NDArray[np.float64], reach: float) -> int | None:
        """Index of the top with headroom nearest to a point (3,) m; None if it is not within ``reach`` m."""
        c, (i, j), (nx, ny) = self._columns, self.grid.cell_of(start), self.grid.shape
        if not (0 <= i < nx and 0 <= j < ny):
            return None
        headroom = self._robot.headroom
        body = kernels.nearest_top(c.start, c.count, c.bottom, c.top, i, j, float(start[2]), reach, headroom)
        return None if body < 0 else int(body)

    def _flood(self, first: NDArray[np.int64], body: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(nx, ny) m, height of the connected ground, and (nx, ny) bool, its edges, as in :func:`kernels.flood`."""
        c = self._columns
        height, edge = np.full(self.grid.shape, np.nan), np.zeros(self.grid.shape, np.bool_)
        kernels.flood(
            c.start, c.count, c.bottom, c.top, c.normal_z, c.owner, self._is_obstacle, *first, body,
            self._max_step, self._robot.headroom, np.cos(self._robot.max_tilt), height, edge,
        )  # fmt: skip
        return height, edge

    def _label(self, height: NDArray[np.float64]) -> NDArray[np.uint8]:
        """(nx, ny) labels of the ground; 0 where there is none."""
        c = self._columns
        owner = np.full(self.grid.shape, -1)
        kernels.write_owners(c.start, c.count, c.top, c.owner, height, owner)
        return np.append(self.bodies.label, np.uint8(Label.UNLABELLED))[owner]

    def _obstacle_distance(
        self,
        height: NDArray[np.float64],
        chosen: NDArray[np.bool_],
        reach: float | None = None,
        min_height: float | None = None,
    ) -> Layer:
        """(nx, ny) m, distance to the nearest chosen body that obstructs the ground; inf only beyond ``reach``.

        ``reach``: m, by default the robot's clearance. ``min_height``: height above the ground, m, up to which a body
        does not obstruct the ground, by default twice the robot's ``max_step``.
        """
        b, distance = self.bodies, np.full(self.grid.shape, np.inf)
        windows = b.windows(self.grid, (self._clearance if reach is None else reach) + CELL)
        windows[~chosen, 1] = 0
        kernels.lower_distance(
            b.corners, b.first_corner, windows, b.low[:, 2], b.high[:, 2], self.grid.origin, CELL, height,
            self._max_step if min_height is None else min_height, self._robot.headroom, distance,
        )  # fmt: skip
        return distance


def clearance_of(robot: RobotModel) -> float:
    """Clearance of the robot's centre from obstacles, m: half its width plus one cell, rounded up to whole cm."""
    return ceil(100 * (robot.half_width + CELL)) / 100


def _grid_around(bodies: ConvexBodies) -> Grid:
    """A grid that covers all bodies, with ``MARGIN`` around them."""
    low, high = bodies.low[:, :2].min(axis=0), bodies.high[:, :2].max(axis=0)
    if not np.prod(high - low) <= MAX_AREA:
        raise InputError(
            f"the arena is too large: {' × '.join(f'{x:.4g}' for x in high - low)} m; the limit is {MAX_AREA:g} m²"
        )
    # Rounding errors must not add a row of cells.
    first = np.floor((low - MARGIN) / CELL + 1e-6).astype(np.int64)
    nx, ny = np.ceil((high + MARGIN - first * CELL) / CELL - 1e-6).astype(int)
    return Grid(first, CELL, (int(nx), int(ny)))


def _tilt(height: NDArray[np.float64]) -> Layer:
    """(nx, ny) rad, tilt by the gentler of the two one-sided slopes along each axis, so that an edge adds no tilt."""
    slopes = []
    for axis in (0, 1):
        forward = np.diff(height, axis=axis, append=np.nan) / CELL
        backward = np.diff(height, axis=axis, prepend=np.nan) / CELL
        sides = np.stack([forward, backward])
        gentler = np.nanmin(np.where(np.isnan(sides), np.inf, np.abs(sides)), axis=0)
        slopes.append(np.where(np.isfinite(gentler), gentler, 0.0))
    return np.arctan(np.hypot(*slopes))
