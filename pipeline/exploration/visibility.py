"""The ground that keyframes at viewpoints are expected to show for the first time."""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pipeline.arrays import Cells, Indices, MaskLayer, Place, Places, Pose, Values
from pipeline.elevation_map.pose_kernels import HEADING_ANGLES
from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.config import VisibilityConfig
from pipeline.frame import Frame
from pipeline.grid_map import blocks
from pipeline.transforms import yaw_of


def camera_view(frame: Frame, config: VisibilityConfig) -> kernels.CameraView:
    """The view of the ground from a frame's camera, with the range reduced by ``max_undershoot``.

    The range is reduced because the robot may stop short of a viewpoint. Nothing is expected within half a ray step
    of the image's lower and upper edges, or within one step of its sides. Values are rounded to 1 mm and 0.1°, so
    that vibrations of the camera do not change the result.
    """
    lens, T, step = frame.intrinsics, frame.T_base_camera, 2 * np.pi / config.rays
    pitch = np.arcsin(T[2, 2])
    left, right = np.arctan([lens.cx / lens.fx, (lens.width - lens.cx) / lens.fx])
    up, down = np.arctan([lens.cy / lens.fy, (lens.height - lens.cy) / lens.fy])
    sensor = frame.sensor
    lengths = (
        T[2, 3],
        T[0, 3],
        sensor.nearest + sensor.margin,
        sensor.farthest - sensor.margin - config.max_undershoot,
    )
    angles = pitch - down + step / 2, pitch + up - step / 2, left + right - 2 * step
    rounded = [round(float(metres), 3) for metres in lengths]
    edges = np.deg2rad(np.degrees(angles).round(1)).tolist()
    return kernels.CameraView(*[*rounded, *edges, sensor.min_grazing_angle, config.rays])


def without_nearest(camera: kernels.CameraView, metres: float) -> kernels.CameraView:
    """A camera that does not see the nearest ``metres`` of level ground in its view."""
    nearest = camera.height / np.tan(-camera.lower_edge)
    lower_edge = float(-np.arctan(camera.height / (nearest + metres)))
    return camera._replace(near=camera.near + metres, lower_edge=lower_edge)


def expected_sight_length(walls: MaskLayer, seen: MaskLayer, cell: float, config: VisibilityConfig) -> float:
    """Length of unknown ground that a ray is expected to see through, m, rounded; longer in a hall than among walls.

    Args:
        walls: cells that block the view.
        seen: cells whose ground was seen.
        cell: side of a cell, m.
        config: settings, of which ``max_blocked_probability`` and ``min_unknown_length`` are used.
    """
    depth = -np.log1p(-config.max_blocked_probability) * mean_free_path(walls, seen, cell)
    return float(rounded(max(config.min_unknown_length, depth)))


def mean_free_path(walls: MaskLayer, seen: MaskLayer, cell: float) -> float:
    """Mean length of a ray over seen ground from one wall to the next, m.

    The mean chord of an area A with perimeter P is π A / P, whatever its shape (Santaló, Integral Geometry and
    Geometric Probability, 1976). Edges of cells are on average 4 / π times as long as the perimeter that they follow.
    """
    ground = seen & ~walls
    edges = sum(
        np.count_nonzero(a[1:] & b[:-1]) + np.count_nonzero(a[:-1] & b[1:])
        for a, b in ((ground, walls), (ground.T, walls.T))
    )
    return 4 * np.count_nonzero(ground) * cell / max(edges, 1)


def rounded(values: ArrayLike) -> NDArray[np.float64]:
    """Values rounded to powers of √2, so that rays are cast anew only when a value changes considerably."""
    return np.asarray(2 ** (np.round(2 * np.log2(values)) / 2))


def gains(places: Places, camera: kernels.CameraView, terrain: kernels.SearchedTerrain) -> NDArray[np.float64]:
    """(N, 16) m², area that viewpoints at N positions are expected to show with each heading."""
    shape = len(places), camera.rays
    return _sums_by_heading(
        kernels.ray_gains(places, camera, terrain, np.ones(shape, np.bool_), np.zeros(shape)), camera
    )


def _sums_by_heading(rays: NDArray[np.float64], camera: kernels.CameraView) -> NDArray[np.float64]:
    """(N, 16) sums of the values of (N, R) rays over the field of view at each heading."""
    half, first = _ray_count_in_view(camera) // 2, _nearest_rays(HEADING_ANGLES, camera)
    sums = np.cumsum(np.hstack([np.zeros((len(rays), 1)), rays[:, -half:], rays, rays[:, :half]]), axis=1)
    return sums[:, first + 2 * half + 1] - sums[:, first]


def cells_in_view(
    position: Place, heading: float, camera: kernels.CameraView, terrain: kernels.SearchedTerrain
) -> MaskLayer:
    """The target cells that a keyframe at a position with a heading (rad) is expected to show."""
    return kernels.cells_in_view(*position, _bearings(heading, camera), camera, terrain)


def count_misses(
    T_map_base: Pose,
    camera: kernels.CameraView,
    terrain: kernels.SearchedTerrain,
    misses: NDArray[np.uint8],
    missed: Indices,
) -> None:
    """Count the target cells that a look was expected to show but did not.

    Args:
        T_map_base: pose of the robot when it looked.
        camera: the camera's view of the ground.
        terrain: the ground and the targets; its ``missed_from`` is updated in place.
        misses: (nx, ny) number of looks that missed each cell; updated in place.
        missed: (256,) number of cells that were missed, by the number of earlier misses; updated in place.
    """
    kernels.count_misses(T_map_base, _bearings(yaw_of(T_map_base), camera), camera, terrain, misses, missed)


def _bearings(heading: float, camera: kernels.CameraView) -> Values:
    """(R,) bearings (rad) of rays across the field of view at a heading (rad)."""
    half, middle = _ray_count_in_view(camera) // 2, int(_nearest_rays(np.array(heading), camera))
    # The result includes exactly the rays from which the gain was computed, because the slightest change may let a
    # ray slip between two cells that meet at a corner. More rays are added for the cells between these rays.
    first = np.arange(middle - half, middle + half + 1) % camera.rays * camera.step
    return np.asarray(first[:, None] + np.arange(3) / 3 * camera.step).ravel()


def _nearest_rays(headings: Values, camera: kernels.CameraView) -> Indices:
    """Indices of the rays nearest to headings (rad).

    A heading halfway between two rays has the same ray whether it is given as 315° or as -45°, whose floating-point
    values differ by more than whole turns.
    """
    return np.asarray(np.rint(np.round(headings % (2 * np.pi) / camera.step, 6)).astype(np.int64))


class ViewpointGains:
    """Cached gains of viewpoints; a ray is cast again only if it may meet both a changed cell and a target."""

    def __init__(self, stride: int) -> None:
        """``stride``: side of the blocks of cells used to find the rays that need not be cast, cells."""
        self._stride = stride
        self._camera: kernels.CameraView | None = None
        self._terrain: kernels.SearchedTerrain | None = None

    def at(self, cells: Cells, camera: kernels.CameraView, terrain: kernels.SearchedTerrain) -> NDArray[np.float64]:
        """(N, 16) m², area that viewpoints in ``cells`` (N, 2) of the terrain are expected to show, by heading."""
        if self._terrain is None or camera != self._camera or not _is_alike(self._terrain, terrain):
            # The cached rays are not valid.
            self._camera, self._terrain, self._cells = camera, terrain, np.zeros((0, 2), np.int64)
            self._rays, self._gains = np.zeros((1, camera.rays)), np.zeros((1, len(HEADING_ANGLES)))
        changed = _changed_cells(self._terrain, terrain)
        rows = np.full(changed.shape, -1, np.int32)
        rows[tuple(self._cells.T)] = np.arange(len(self._cells))
        row = rows[tuple(cells.T)]
        if (row >= 0).all() and not changed.any():
            return self._gains[row]
        # New cells, whose row is -1, first get the rays of another cell, which are then replaced.
        rays, sums = (earlier.take(row, axis=0, mode="clip") for earlier in (self._rays, self._gains))
        renewed = self._may_meet(changed, cells, camera, terrain.cell)
        renewed[row < 0] = True
        rays[renewed] = 0.0
        some = renewed.any(axis=1)
        wanted = renewed[some] & self._may_meet(terrain.target, cells[some], camera, terrain.cell)
        places = terrain.origin + (cells[some] + 0.5) * terrain.cell
        rays[some] = kernels.ray_gains(places, camera, terrain, wanted, rays[some])
        sums[some] = _sums_by_heading(rays[some], camera)
        self._terrain, self._cells = terrain, cells
        if len(cells):
            self._rays, self._gains = rays, sums
        return sums

    def _may_meet(self, mask: MaskLayer, cells: Cells, camera: kernels.CameraView, cell: float) -> NDArray[np.bool_]:
        """(N, R) whether each ray from N cells may meet a cell of a mask."""
        stride, wanted = self._stride, np.zeros((len(cells), camera.rays), np.bool_)
        parts, side = np.asarray(blocks(mask, stride).any(axis=0)), stride * cell
        here = tuple(cells.T // stride)
        # For an empty mask, the distances are meaningless, but then no ray meets a block either.
        near = (ndimage.distance_transform_edt(~parts) <= camera.reach / side + 2)[here]
        # From outside, a ray enters a piece of the mask through its boundary.
        rim = parts & ~ndimage.binary_erosion(parts, np.ones((3, 3)))
        rays = _rays_by_offset(camera.reach, cell, stride, camera.rays)
        wanted[near] = kernels.are_towards(cells[near], rim, rays, stride, camera.rays)
        wanted[parts[here]] = True
        return wanted


def _is_alike(before: kernels.SearchedTerrain, terrain: kernels.SearchedTerrain) -> bool:
    """Whether two terrains have the same grid and parameters, whatever values their layers hold."""
    same = before.target.shape == terrain.target.shape and (before.origin == terrain.origin).all()
    return bool(same) and all(a == b for a, b in zip(before, terrain, strict=True) if not isinstance(a, np.ndarray))


def _changed_cells(before: kernels.SearchedTerrain, terrain: kernels.SearchedTerrain) -> MaskLayer:
    """The cells in which any layer differs between two terrains with the same grid."""
    changed = np.zeros(terrain.target.shape, np.bool_)
    layers = "elevation", "gradient", "target", "probability", "missed_from"
    for old, new in ((getattr(before, name), getattr(terrain, name)) for name in layers):
        if old is not new:
            differs = _bits(old) != _bits(new)
            changed |= differs if differs.ndim == 2 else differs[..., 0] | differs[..., 1]
    return changed


def _bits(values: NDArray) -> NDArray:
    """The bits of the values as integers, so that NaN equals NaN."""
    return values.view(f"u{values.itemsize}")


@cache
def _rays_by_offset(reach: float, cell: float, stride: int, count: int) -> NDArray[np.int16]:
    """(S, S, 2) the half-open range of rays from a cell to a block within ``reach`` m of it.

    The first two indices are the position of the block's middle cell in a square of cells that is centred on the
    cell. Ray numbers may be negative or exceed ``count``; the range is empty if the block is farther away.
    """
    most, radius, step = int(reach / cell) + stride, stride * cell / np.sqrt(2), 2 * np.pi / count
    i, j = cell * (np.indices((2 * most + 1,) * 2) - most)
    distance, bearing = np.hypot(i, j), np.arctan2(j, i)
    half = np.where(distance > radius, np.arcsin(radius / np.maximum(distance, radius)), np.pi)
    first, last = np.floor((bearing - half) / step), np.ceil((bearing + half) / step)
    return np.stack([first, np.where(distance <= reach + radius, last + 1, first)], axis=-1).astype(np.int16)


def _ray_count_in_view(camera: kernels.CameraView) -> int:
    """Number of rays across the camera's field of view."""
    return round(camera.field_of_view / (2 * np.pi) * camera.rays)
