"""Which ground keyframes from viewpoints are expected to show for the first time."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.elevation_map.pose_kernels import ANGLES
from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.visibility_kernels import RAY_STEP, RAYS
from pipeline.frame import Frame
from pipeline.grid_map import blocks
from pipeline.localisation.localisation import KEYFRAME_WAY
from pipeline.transforms import yaw_of

PLACE_STRIDE = 5
"""Cells along each side of the blocks, each of which has one place for viewpoints."""


def camera_view(frame: Frame) -> kernels.CameraView:
    """What the camera that took a frame sees of the ground, from up to ``KEYFRAME_WAY`` short of a viewpoint.

    Nothing is expected within half a ray's step of the image's lower and upper edge, and within one of its sides.
    Values are rounded to 1 mm and 0.1°, so that a camera that trembles on its mount stays the same.
    """
    lens, T = frame.intrinsics, frame.T_base_camera
    pitch = np.arcsin(T[2, 2])
    left, right = np.arctan([lens.cx / lens.fx, (lens.width - lens.cx) / lens.fx])
    up, down = np.arctan([lens.cy / lens.fy, (lens.height - lens.cy) / lens.fy])
    sensor = frame.sensor
    lengths = T[2, 3], T[0, 3], sensor.nearest + sensor.margin, sensor.farthest - sensor.margin - KEYFRAME_WAY
    angles = pitch - down + RAY_STEP / 2, pitch + up - RAY_STEP / 2, left + right - 2 * RAY_STEP
    rounded = [round(float(metres), 3) for metres in lengths]
    edges = np.deg2rad(np.degrees(angles).round(1)).tolist()
    return kernels.CameraView(*rounded, *edges)._replace(grazing=sensor.grazing)


def gains(
    places: NDArray[np.float64], camera: kernels.CameraView, terrain: kernels.SearchedTerrain
) -> NDArray[np.float64]:
    """(N, 16) m² that viewpoints at (N, 2) places, m, along each heading should show."""
    shape = len(places), RAYS
    return _by_heading(kernels.ray_gains(places, camera, terrain, np.ones(shape, np.bool_), np.zeros(shape)), camera)


def _by_heading(rays: NDArray[np.float64], camera: kernels.CameraView) -> NDArray[np.float64]:
    """(N, 16) sums of the values of (N, RAYS) rays over the field of view along each heading."""
    half, first = _rays_in_view(camera) // 2, np.rint(ANGLES / RAY_STEP).astype(int)
    sums = np.cumsum(np.hstack([np.zeros((len(rays), 1)), rays[:, -half:], rays, rays[:, :half]]), axis=1)
    return sums[:, first + 2 * half + 1] - sums[:, first]


def cells_in_view(
    position: NDArray[np.float64], heading: float, camera: kernels.CameraView, terrain: kernels.SearchedTerrain
) -> NDArray[np.bool_]:
    """(nx, ny) the target cells that a viewpoint at (2,) m with a heading (rad) should show."""
    return kernels.cells_in_view(*position, _bearings(heading, camera), camera, terrain)


def count_misses(
    poses: NDArray[np.float64],
    camera: kernels.CameraView,
    terrain: kernels.SearchedTerrain,
    misses: NDArray[np.uint8],
    missed: NDArray[np.int64],
) -> None:
    """Count the target cells that keyframes should have shown and did not, in the order of their poses.

    Args:
        poses: (K, 4, 4) of the keyframes.
        camera: its view of the ground.
        terrain: the ground as known; ``missed_from`` is renewed in place.
        misses: (nx, ny) number of keyframes that missed each cell; renewed in place.
        missed: (256,) number of cells that were missed, by how often they had been missed before; added to in place.
    """
    for T in poses:
        kernels.count_misses(*T[:2, 3], _bearings(yaw_of(T), camera), camera, terrain, misses, missed)


def _bearings(heading: float, camera: kernels.CameraView) -> NDArray[np.float64]:
    """(M,) rad, bearings of rays all over the field of view along a heading, rad."""
    half = _rays_in_view(camera) // 2
    middle = round(heading / (2 * np.pi) * RAYS)
    # The rays from which the gain was computed, bit for bit, for one may slip through where two cells meet at a
    # corner; and rays in between, for the cells that lie between them.
    first = np.arange(middle - half, middle + half + 1) % RAYS * RAY_STEP
    return np.asarray(first[:, None] + np.arange(3) / 3 * RAY_STEP).ravel()


class ViewpointGains:
    """Gains of viewpoints; casts only those rays again that may meet changed cells, if they may meet targets."""

    def __init__(self) -> None:
        self._camera: kernels.CameraView | None = None
        self._origin, self._falls = np.full(2, np.nan), True
        self._cells = np.zeros((0, 2), np.int64)
        self._rays, self._gains = np.zeros((1, RAYS)), np.zeros((1, len(ANGLES)))

    def of(
        self,
        cells: NDArray[np.int64],
        camera: kernels.CameraView,
        terrain: kernels.SearchedTerrain,
        changed: NDArray[np.bool_],
    ) -> NDArray[np.float64]:
        """(N, 16) m² that viewpoints along each heading should show.

        Args:
            cells: (N, 2) elements of the viewpoints.
            camera: its view of the ground.
            terrain: the ground as known.
            changed: (nx, ny) cells of the terrain that changed since the last call. All rays are cast anew if the
                camera is another, if the grid begins elsewhere, or if the ground behind crests is guessed otherwise.
        """
        if camera != self._camera or terrain.falls != self._falls or (terrain.origin != self._origin).any():
            self._camera, self._origin, self._falls = camera, terrain.origin, terrain.falls
            changed = np.ones_like(changed)
        rows = np.full(changed.shape, -1, np.int32)
        rows[tuple(self._cells.T)] = np.arange(len(self._cells))
        row = rows[tuple(cells.T)]
        # New cells have row -1: they first get the rays of any other cell, which are then renewed.
        rays, sums = (known.take(row, axis=0, mode="clip") for known in (self._rays, self._gains))
        renewed = _towards(changed, cells, camera, terrain)
        renewed[row < 0] = True
        rays[renewed] = 0.0
        some = renewed.any(axis=1)
        wanted = renewed[some] & _towards(terrain.target, cells[some], camera, terrain)
        rays[some] = kernels.ray_gains(_places(cells[some], terrain), camera, terrain, wanted, rays[some])
        sums[some] = _by_heading(rays[some], camera)
        self._cells = cells
        if len(cells):
            self._rays, self._gains = rays, sums
        return sums


def _towards(
    mask: NDArray[np.bool_], cells: NDArray[np.int64], camera: kernels.CameraView, terrain: kernels.SearchedTerrain
) -> NDArray[np.bool_]:
    """(N, RAYS) the rays from cells (N, 2) that may meet a cell of a mask (nx, ny)."""
    wanted = np.zeros((len(cells), RAYS), np.bool_)
    parts, side = np.asarray(blocks(mask, PLACE_STRIDE).any(axis=0)), PLACE_STRIDE * terrain.cell
    here = tuple(cells.T // PLACE_STRIDE)
    # For an empty mask the distances mean nothing, but then no ray meets a square either.
    near = (ndimage.distance_transform_edt(~parts) <= camera.reach / side + 2)[here]
    # From outside, a ray enters a piece of the mask through its rim.
    rim = parts & ~ndimage.binary_erosion(parts, np.ones((3, 3)))
    wanted[near] = kernels.rays_towards(cells[near], rim, _rays_by_offset(camera.reach, terrain.cell), PLACE_STRIDE)
    wanted[parts[here]] = True
    return wanted


@cache
def _rays_by_offset(reach: float, cell: float) -> NDArray[np.int16]:
    """(S, S, 2) the first ray, and the first after the last, from a cell to a block within ``reach`` m of it.

    Indices are those of the block's middle cell, from the corner of a square around the cell; rays may be beyond 0 to
    ``RAYS``, and are none if the block is farther away.
    """
    most, radius = int(reach / cell) + PLACE_STRIDE, PLACE_STRIDE * cell / np.sqrt(2)
    i, j = cell * (np.indices((2 * most + 1,) * 2) - most)
    distance, bearing = np.hypot(i, j), np.arctan2(j, i)
    half = np.where(distance > radius, np.arcsin(radius / np.maximum(distance, radius)), np.pi)
    first, last = np.floor((bearing - half) / RAY_STEP), np.ceil((bearing + half) / RAY_STEP)
    return np.stack([first, np.where(distance <= reach + radius, last + 1, first)], axis=-1).astype(np.int16)


def _places(cells: NDArray[np.int64], terrain: kernels.SearchedTerrain) -> NDArray[np.float64]:
    """(N, 2) m, the middles of cells."""
    return terrain.origin + (cells + 0.5) * terrain.cell


def _rays_in_view(camera: kernels.CameraView) -> int:
    return round(camera.field_of_view / (2 * np.pi) * RAYS)
