"""The ground as it is: where a Pioneer 3-AT may truly stand and be driven to."""

from collections import deque
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.surface.grid import Grid
from sarsim.camera import geom_labels
from sarsim.contacts import OBSTACLES

CELL = 0.05
MAX_STEP = 0.08
MAX_TILT = np.deg2rad(20)
CLEARANCE = 0.30
HEADROOM = 0.65
MARGIN = 0.5
"""m of grid around the arena."""


@dataclass(frozen=True, eq=False)
class TrueSurface:
    """The true ground on a grid of 5 cm cells; layers are (nx, ny).

    Attributes:
        grid: where the cells lie.
        height: float64 m of the ground in each cell; NaN where the robot cannot come over the neighbouring cells.
        drivable: bool, connected to the start, and from 0.30 m around free of steps above 0.08 m, tilt above 20°,
            walls and clutter, with 0.65 m of headroom.
        walls: bool, a wall stands in the cell at the height of the robot's body.
    """

    grid: Grid
    height: NDArray[np.float64]
    drivable: NDArray[np.bool_]
    walls: NDArray[np.bool_]


class VerticalRays:
    """Asks a model what is above and below a point; the robot is transparent."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, robot_body: int):
        self._model, self._data, self._robot = model, data, robot_body
        self._hidden = model.body_rootid[model.geom_bodyid] == robot_body
        self.labels = geom_labels(model)

    def cast(self, point: NDArray[np.float64], direction: float) -> tuple[float, int]:
        """Distance in m to the first geom straight up (+1) or down (−1), and its id; inf and −1 if there is none."""
        origin, travelled = point.astype(np.float64).copy(), 0.0
        geom = np.full(1, -1, np.int32)
        vector = np.array([0.0, 0.0, direction])
        while True:
            distance = mujoco.mj_ray(self._model, self._data, origin, vector, None, 1, -1, geom, None)
            if distance < 0:
                return np.inf, -1
            travelled += distance
            if not self._hidden[geom[0]]:
                return travelled, int(geom[0])
            origin[2] += direction * (distance + 1e-4)
            travelled += 1e-4

    def ground(self, xy: NDArray[np.float64], from_height: float) -> tuple[float, int] | None:
        """Height and geom of the ground under a point that has headroom; None inside a body or above nothing."""
        point = np.array([*xy, from_height + HEADROOM])
        below, geom_below = self.cast(point, -1.0)
        above, geom_above = self.cast(point, 1.0)
        # A ray that starts inside a (convex) body meets that body both ways.
        if geom_below < 0 or geom_below == geom_above:
            return None
        height = point[2] - below
        headroom = below + above
        return (height, geom_below) if headroom >= HEADROOM else None


def true_surface(
    model: mujoco.MjModel, data: mujoco.MjData, robot_body: int, start: NDArray[np.float64]
) -> TrueSurface:
    """Survey the arena from the ``start`` (3,) m outwards.

    Raises:
        InputError: the start itself is not drivable.
    """
    rays = VerticalRays(model, data, robot_body)
    grid = _grid_around(model, data, robot_body)
    height, edge = _flood(rays, grid, start)
    near_wall, near_obstacle = _obstacles(model, data, rays.labels, grid, height)
    known = ~np.isnan(height)
    hazard = known & (edge | (_tilt(height) > MAX_TILT))
    clear = ndimage.distance_transform_edt(~hazard) * CELL > CLEARANCE
    free = known & clear & ~near_obstacle
    pieces, _ = ndimage.label(free, np.ones((3, 3)))
    i, j = grid.cell_of(start)
    if not pieces[i, j]:
        raise InputError(
            f"the arena has no free start: the robot cannot stand at ({start[0]:g}, {start[1]:g}) m"
        )
    return TrueSurface(grid, height, pieces == pieces[i, j], near_wall)


def _grid_around(model: mujoco.MjModel, data: mujoco.MjData, robot_body: int) -> Grid:
    """A grid over all geoms of the arena; an infinite plane counts as 50 m."""
    arena = np.flatnonzero(model.body_rootid[model.geom_bodyid] != robot_body)
    centre, half = model.geom_aabb[arena, :3].copy(), model.geom_aabb[arena, 3:].copy()
    plane = model.geom_type[arena] == mujoco.mjtGeom.mjGEOM_PLANE
    size = model.geom_size[arena[plane], :2]
    half[plane] = np.column_stack([np.where(size > 0, size, 25.0), np.zeros(plane.sum())])
    R = data.geom_xmat[arena].reshape(-1, 3, 3)
    middle = data.geom_xpos[arena] + np.einsum("nij,nj->ni", R, np.where(plane[:, None], 0, centre))
    reach = np.einsum("nij,nj->ni", np.abs(R), half)
    low, high = (middle - reach)[:, :2].min(axis=0), (middle + reach)[:, :2].max(axis=0)
    origin = np.floor((low - MARGIN) / CELL) * CELL
    nx, ny = np.ceil((high + MARGIN - origin) / CELL).astype(int)
    return Grid(origin, CELL, (int(nx), int(ny)))


def _flood(
    rays: VerticalRays, grid: Grid, start: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Heights of all ground that steps of at most ``MAX_STEP`` join to the start, and where it ends in a step."""
    height = np.full(grid.shape, np.nan)
    edge = np.zeros(grid.shape, np.bool_)
    first = tuple(grid.cell_of(start))
    ground = rays.ground(grid.centre_of(first), start[2])
    if ground is None:
        raise InputError(
            f"the arena has no free start: ({start[0]:g}, {start[1]:g}) m is not above free ground"
        )
    height[first] = ground[0]
    queue = deque([first])
    while queue:
        i, j = queue.popleft()
        for a in range(max(i - 1, 0), min(i + 2, grid.shape[0])):
            for b in range(max(j - 1, 0), min(j + 2, grid.shape[1])):
                if np.isnan(height[a, b]):
                    ground = rays.ground(grid.centre_of((a, b)), height[i, j])
                    if ground is not None and abs(ground[0] - height[i, j]) <= MAX_STEP:
                        height[a, b] = ground[0]
                        queue.append((a, b))
                    elif ground is not None and rays.labels[ground[1]] not in OBSTACLES:
                        edge[i, j] = True
                elif abs(height[a, b] - height[i, j]) > MAX_STEP:
                    edge[i, j] = edge[a, b] = True
    return height, edge


def _tilt(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """(nx, ny) rad of the ground; the gentler of the two sides counts, so that an edge tilts nothing."""
    slopes = []
    for axis in (0, 1):
        forward = np.diff(height, axis=axis, append=np.nan) / CELL
        backward = np.diff(height, axis=axis, prepend=np.nan) / CELL
        sides = np.stack([forward, backward])
        gentler = np.nanmin(np.where(np.isnan(sides), np.inf, np.abs(sides)), axis=0)
        slopes.append(np.where(np.isfinite(gentler), gentler, 0.0))
    return np.arctan(np.hypot(*slopes))


def _obstacles(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    labels: NDArray[np.uint8],
    grid: Grid,
    height: NDArray[np.float64],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Cells with a wall in them, and cells with a wall, clutter or a victim within ``CLEARANCE``."""
    walls = np.zeros(grid.shape, np.bool_)
    near = np.zeros(grid.shape, np.bool_)
    for geom in np.flatnonzero(np.isin(labels, OBSTACLES)):
        footprint = _footprint(model, data, int(geom))
        low, high = footprint[:, :2].min(axis=0) - CLEARANCE, footprint[:, :2].max(axis=0) + CLEARANCE
        first = np.maximum(grid.cell_of(low), 0)
        window = tuple(slice(a, max(b + 1, 0)) for a, b in zip(first, grid.cell_of(high), strict=True))
        ground = height[window]
        if not ground.size:
            continue
        distance = _distance_to(footprint[:, :2], grid, first, ground.shape)
        # What ends at the height of a step or begins above the headroom is in nobody's way.
        in_the_way = (footprint[:, 2].max() > ground + MAX_STEP) & (footprint[:, 2].min() < ground + HEADROOM)
        near[window] |= in_the_way & (distance <= CLEARANCE)
        if labels[geom] == Label.WALL:
            walls[window] |= distance <= CELL / 2
    return walls, near


def _footprint(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> NDArray[np.float64]:
    """(N, 3) points on a geom, at most 2 cm apart: of a box exactly, of other shapes on the box around them."""
    centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    axes = [np.linspace(-h, h, max(2, int(np.ceil(h / 0.01)) + 1)) for h in half]
    # Only the outline matters: the four upright sides, at top and bottom.
    x, y, z = (g.ravel() for g in np.meshgrid(*axes, indexing="ij"))
    on_side = (np.abs(x) >= half[0] - 1e-9) | (np.abs(y) >= half[1] - 1e-9) | (np.abs(z) >= half[2] - 1e-9)
    local = centre + np.column_stack([x, y, z])[on_side]
    return local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def _distance_to(
    points: NDArray[np.float64], grid: Grid, first: NDArray[np.int64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    """(nx, ny) m from the centres of a window of cells to the nearest of (N, 2) points."""
    cells = np.moveaxis(np.indices(shape), 0, -1) + first
    distance, _ = KDTree(points).query(grid.centre_of(cells))
    return distance
