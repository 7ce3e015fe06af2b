"""The robot's start pose in an arena."""

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Layer, MaskLayer, Pose, Values
from pipeline.errors import InputError
from pipeline.grid_map import Grid
from pipeline.labels import Label
from pipeline.transforms import from_yaw, yaw_of
from sarsim.ground_truth.contacts import OBSTACLES
from sarsim.ground_truth.true_surface import CELL, FreeGround, Survey

HEADINGS = np.arange(16) * 2 * np.pi / 16  # rad, headings that are compared
MAX_COMPARED_LENGTH = 3.0  # m; a greater length of free floor ahead counts as this one when starts are compared
MAX_COMPARED_CLEARANCE = 0.6  # m; a greater clearance counts as this one when starts are compared
HALF_WIDTH = 0.35  # m of free floor required on both sides of the line ahead
MAX_UNEVENNESS = 0.02  # m by which the floor around the start may rise or fall
MAX_RISE_WITHIN_LEVEL = 0.5  # m; floor that is more than this above the lowest floor belongs to another level
OUTSIDE_WEIGHT = 0.02  # Weight of a cell outside the arena when pieces of ground are compared by size
MAX_PLACES = 2000  # Maximum number of positions that are compared
MAX_GROUNDS = 10  # Maximum number of connected grounds that are compared, the largest patches of floor first
PROBE_HEIGHT = 0.3  # m, height above a start from which the ground below is searched for
MAX_GROUND_GAP = 0.005  # m; a start at most this far from the ground is considered to be on it
SLOPE_BASELINE = 0.05  # m, distance over which the slope of the ground at a start is measured
MAX_UPRIGHT_TILT = np.radians(0.5)  # Maximum tilt of a start that is considered upright, rad
MIN_START_AREA = 0.25  # m², minimum area in which the robot's centre can move; a tile between four walls has 0.35 m²


class Start(NamedTuple):
    """The start pose of ``base_link``: position x, y, z, m, and yaw, rad."""

    position: tuple[float, float, float]
    yaw: float


def start_at(model: mujoco.MjModel, data: mujoco.MjData, x: float, y: float, yaw_deg: float) -> Start:
    """The start at a requested position, on the lowest ground with headroom at this position.

    Whether the ground is wide and level enough depends on the robot, which is not known here.

    Raises:
        InputError: there is no free ground at the position, or a number is not finite.
    """
    if not np.isfinite((x, y, yaw_deg)).all():
        raise InputError(f"--start {x:g} {y:g} {yaw_deg:g}: all three numbers must be finite")
    survey = Survey(model, data)
    low = np.array([x, y, survey.bodies.low[:, 2].min()])
    height = survey.ground_height_near(low, reach=np.inf)
    ground = None if height is None else survey.ground_from(np.array([x, y, height]))
    here = tuple(survey.grid.cell_of(low))
    if ground is None or ground.label[here] in OBSTACLES or ground.obstacle_distance[here] < CELL:
        raise InputError(f"the robot cannot stand at the start ({x:g}, {y:g}) m; choose another with --start X Y YAW")
    return Start((x, y, float(height or 0.0)), np.radians(yaw_deg))


def moved_to_ground(model: mujoco.MjModel, data: mujoco.MjData, T_world_start: Pose) -> tuple[Pose, str]:
    """A marked start, moved upright onto the nearest ground, and a description of the change; empty if unchanged.

    Raises:
        InputError: there is no ground with headroom below or above the start.
    """
    x, y, z = T_world_start[:3, 3]
    down = np.array([0.0, 0.0, -1.0])
    over, ahead, beside = (
        mujoco.mj_ray(model, data, np.array([x, y, z + PROBE_HEIGHT]) + off, down, None, 1, -1, np.zeros(1, np.int32))
        - PROBE_HEIGHT
        for off in SLOPE_BASELINE * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    )
    # On a slope, a start perpendicular to the slope is also considered upright.
    up = np.array([ahead - over, beside - over, SLOPE_BASELINE])
    on_slope = float(np.arccos(np.clip(T_world_start[:3, 2] @ up / np.linalg.norm(up), -1, 1)))
    tilt = min(float(np.arccos(np.clip(T_world_start[2, 2], -1, 1))), on_slope)
    if abs(over) > MAX_GROUND_GAP:
        height = Survey(model, data).ground_height_near(T_world_start[:3, 3], reach=np.inf)
        if height is None:
            raise InputError(
                f"there is no free ground at ({x:g}, {y:g}) m; choose another start with --start X Y YAW"
            )
        over = float(z - height)
    if abs(over) <= MAX_GROUND_GAP and tilt <= MAX_UPRIGHT_TILT:
        return T_world_start, ""
    above = f"{abs(over):.2f} m {'above' if over > 0 else 'below'} the ground" if abs(over) > MAX_GROUND_GAP else ""
    tilted = f"tilted by {np.degrees(tilt):.0f}°" if tilt > MAX_UPRIGHT_TILT else ""
    said = f"the start is {' and '.join(filter(None, (above, tilted)))}; the robot starts upright on the ground"
    return from_yaw(x, y, z - over, yaw_of(T_world_start)), said


def find_start(model: mujoco.MjModel, data: mujoco.MjData) -> Start:
    """The best start on the floor of the largest connected piece of drivable ground.

    To provide an open view and room to turn, the best start maximises the length of free, level floor ahead plus
    twice the clearance.

    Raises:
        InputError: there is no free floor.
    """
    survey = Survey(model, data)
    best: tuple[float, FreeGround, NDArray[np.bool_]] | None = None
    for ground in islice(survey.grounds(Label.TERRAIN, MIN_START_AREA), MAX_GROUNDS):
        for floor, size in _pieces(ground):
            if best is None or size > best[0]:
                best = (size, ground, floor)
    if best is None:
        raise InputError(
            "the robot does not fit on any tile of the arena's floor; choose a start with --start X Y YAW"
        )
    return _most_open_start(*best[1:])


def _pieces(ground: FreeGround) -> Iterator[tuple[NDArray[np.bool_], float]]:
    """Yield the floor cells, (nx, ny) bool, of each connected piece of ground and the piece's weighted cell count."""
    weight = np.where(_is_inside(ground), 1.0, OUTSIDE_WEIGHT)
    for piece in range(1, int(ground.pieces.max()) + 1):
        cells = ground.pieces == piece
        floor = cells & (ground.label == Label.TERRAIN)
        if floor.any() and cells.sum() * CELL**2 > MIN_START_AREA:
            yield floor, round(float(weight[cells].sum()), 3)


def _is_inside(ground: FreeGround) -> MaskLayer:
    """(nx, ny) bool, cells with an obstacle in each of the four axis directions."""
    solid = ground.obstacle_distance < CELL
    sides = np.zeros(solid.shape, np.int64)
    for axis in (0, 1):
        sides += np.maximum.accumulate(solid, axis)
        sides += np.flip(np.maximum.accumulate(np.flip(solid, axis), axis), axis)
    return sides == 4


def _most_open_start(ground: FreeGround, floor: NDArray[np.bool_]) -> Start:
    """The best start on the lowest level of a floor.

    The lowest level is used because robots map more above the start than below it. If the floor has too many cells,
    only some of the cells are compared.
    """
    floor = floor & (ground.height <= ground.height[floor].min() + MAX_RISE_WITHIN_LEVEL)
    inside = floor & _is_inside(ground)
    cells = _thinned(np.argwhere(inside if inside.any() else floor))
    clearance = _clearance(ground, float(np.median(ground.height[floor])))
    ahead = np.stack([_free_ahead(ground.grid, clearance, cells, h) for h in HEADINGS], axis=1)
    room = np.minimum(clearance[tuple(cells.T)], MAX_COMPARED_CLEARANCE)
    # Rounded so that rounding errors do not break ties.
    score = np.round(ahead + 2 * room[:, None], 3)
    cell, heading = np.unravel_index(score.argmax(), score.shape)
    x, y = ground.grid.centre_of(cells[cell])
    return Start((float(x), float(y), float(ground.height[tuple(cells[cell])])), float(HEADINGS[heading]))


def _thinned(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cells (N, 2), thinned repeatedly to every second one along both axes until at most ``MAX_PLACES`` are left."""
    spacing = 1
    while len(cells) > MAX_PLACES:
        spacing *= 2
        fewer = cells[(cells % spacing == 0).all(axis=1)]
        if not len(fewer):
            break
        cells = fewer
    return cells


def _clearance(ground: FreeGround, level: float) -> Layer:
    """(nx, ny) m, distance from each cell to the nearest cell that is not free, level floor."""
    free = (np.abs(ground.height - level) <= MAX_UNEVENNESS) & (ground.obstacle_distance >= CELL)
    return ndimage.distance_transform_edt(free) * CELL


def _free_ahead(grid: Grid, clearance: Layer, cells: NDArray[np.int64], heading: float) -> Values:
    """(N,) m, length of free floor ahead of cells (N, 2) in direction ``heading``, rad.

    The length is at most ``MAX_COMPARED_LENGTH``.
    """
    distance = np.arange(1, round(MAX_COMPARED_LENGTH / CELL) + 1) * CELL
    way = grid.centre_of(cells)[:, None] + distance[:, None] * [np.cos(heading), np.sin(heading)]
    free = grid.at(clearance, way) >= HALF_WIDTH
    return CELL * np.logical_and.accumulate(free, axis=1).sum(axis=1)
