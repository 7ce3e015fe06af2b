"""Scans: which voxels one depth image or point cloud hits and frees, before the map adds them to its log-odds."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.metric_map.grid_kernels import box_around
from pipeline.metric_map.projection_kernels import BLOCK, TILE, observe
from pipeline.metric_map.ray_kernels import mark_ends, trace_points


@dataclass(frozen=True, eq=False)
class Scan:
    """A box of marks, which begins and ends at whole multiples of BLOCK voxels.

    Attributes:
        lower: (3,) int64 voxel index of the box's first voxel.
        marks: (nx, ny, nz) uint8: 0 unseen, 1 free, 2 hit.
        flat: the same marks in C order, and one last element that stands for "nowhere".
    """

    lower: NDArray[np.int64]
    marks: NDArray[np.uint8]
    flat: NDArray[np.uint8]


class Updater:
    """Turns depth images and point clouds into scans of a grid whose voxel (0, 0, 0) starts at the origin.

    A scan is valid until the next one: they share one buffer, which saves allocations.
    """

    def __init__(self, voxel_size: float, max_range: float, margin: float, max_bytes: int) -> None:
        """The arguments are those of :class:`pipeline.metric_map.metric_map.MetricMap`."""
        self._voxel_size, self._max_range, self._margin = voxel_size, max_range, margin
        self._max_bytes = min(max_bytes, 2**31 - 1)  # the kernels count marks in 32 bits
        self._memory = np.zeros(0, np.uint8)

    def project(
        self,
        depth: NDArray[np.float32],
        intrinsics: Intrinsics,
        T_grid_camera: NDArray[np.float64],
        ends: NDArray[np.float32],
    ) -> Scan:
        """The voxels in which a depth image's rays end and those they cross, by projecting voxels into the image.

        Args:
            depth: (H, W) float32, m along the optical axis; NaN, infinite and non-positive values are no return.
            intrinsics: of the depth image.
            T_grid_camera: 4×4 pose of ``camera_optical`` in the grid's frame.
            ends: (N, 3) float32 further end points, m in the grid's frame.

        Raises:
            InputError: the box of marks alone exceeds the map's memory bound; :meth:`trace` raises it too.
        """
        pose = T_grid_camera[:3].copy()
        pose[:, 3] /= self._voxel_size
        frustum = _frustum(intrinsics) * (self._max_range / self._voxel_size)
        scan = self._scan_around(frustum @ pose[:, :3].T + pose[:, 3])
        mark_ends(ends, T_grid_camera, self._voxel_size, self._max_range, scan.lower, scan.marks)
        pose[:, 3] -= scan.lower
        pinhole = np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy])
        pyramid = np.empty(_pyramid_shape(*depth.shape), np.float32)
        limits = self._voxel_size, self._max_range, self._margin
        observe(depth, pinhole, pose, *limits, scan.marks, scan.flat, pyramid)
        return scan

    def trace(self, points: NDArray[np.float64], origin: NDArray[np.float64]) -> Scan:
        """The voxels that contain (N, 3) finite points and those that the rays to them from a (3,) origin cross.

        Points and origin are float64, m in the grid's frame.
        """
        rays = points - origin
        length = np.linalg.norm(rays, axis=1)
        free = np.maximum(np.minimum(length, self._max_range) - self._margin, 0)
        stops = origin + rays * np.divide(free, length, out=np.zeros_like(length), where=length > 0)[:, None]
        ends = length <= self._max_range
        scan = self._scan_around(np.vstack([origin[None], stops, points[ends]]) / self._voxel_size)
        points, stops, origin = (array / self._voxel_size - scan.lower for array in (points, stops, origin))
        trace_points(points, stops, ends, origin, scan.marks)
        return scan

    def _scan_around(self, points: NDArray[np.float64]) -> Scan:
        """An empty scan around (N, 3) points, in voxels in the grid's frame, with a voxel to spare for rounding."""
        x, y, z, nx, ny, nz = box_around(points, BLOCK)
        size = nx * ny * nz + 1
        if size > self._max_bytes:
            raise InputError(f"a scan of {size} voxels exceeds the map's bound of {self._max_bytes} bytes")
        if size > self._memory.size:
            self._memory = np.empty(size, np.uint8)
        flat = self._memory[:size]
        flat.fill(0)
        return Scan(np.array((x, y, z)), flat[:-1].reshape(nx, ny, nz), flat)


@lru_cache(maxsize=8)
def _frustum(intrinsics: Intrinsics) -> NDArray[np.float64]:
    """(5, 3) corners of the view frustum up to a depth of 1 m, in ``camera_optical``."""
    u = (np.array([0, intrinsics.width]) - intrinsics.cx) / intrinsics.fx
    v = (np.array([0, intrinsics.height]) - intrinsics.cy) / intrinsics.fy
    return np.array([(0, 0, 0), *((a, b, 1) for a in u for b in v)])


@lru_cache(maxsize=8)
def _pyramid_shape(height: int, width: int) -> tuple[int, int, int]:
    """Levels, rows and columns of the pyramid's tiles; the last level uses at most 3 × 3 of them."""
    rows, columns = -(-height // TILE), -(-width // TILE)
    return 1 + max(0, int(np.ceil(np.log2(max(rows, columns) / 3)))), rows, columns
