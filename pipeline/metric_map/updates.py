"""Scans: the voxels that a depth image or point cloud hits and frees, before the map adds them to its log-odds."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Place, Places, Points, Pose
from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.geometry.ray_kernels import trace_rays
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.grid_kernels import box_around, mark_ends
from pipeline.metric_map.projection_kernels import BLOCK, TILE, mark_depth_image
from pipeline.transforms import transform_places

NARROW_DEPTH = 6.0
"""Depth up to which rays are traced, voxels, because the view is narrow enough to pass between corners there."""


@dataclass(frozen=True, eq=False)
class Scan:
    """A box of marks that begins and ends at multiples of BLOCK voxels.

    Attributes:
        lower: (3,) int64 index of the box's first voxel.
        marks: (nx, ny, nz) uint8: 0 unseen, 1 free, 2 hit.
        flat: the same marks in C order, and a last element that takes the marks of pixels without an end point.
    """

    lower: NDArray[np.int64]
    marks: NDArray[np.uint8]
    flat: NDArray[np.uint8]


class ScanBuilder:
    """Turns depth images and point clouds into scans of a grid whose voxel (0, 0, 0) begins at the origin.

    A scan is valid only until the next one, because all scans share a buffer to save allocations.
    """

    def __init__(self, config: MetricMapConfig) -> None:
        self._config = config
        self._max_bytes = min(config.max_bytes, np.iinfo(np.int32).max)  # the kernels count marks in 32 bits
        self._buffer = np.zeros(0, np.uint8)

    def project(self, depth: Depth, intrinsics: Intrinsics, T_grid_camera: Pose, ends: Points) -> Scan:
        """Project voxels into a depth image to find the voxels in which rays end and the voxels that rays cross.

        Args:
            depth: depth image, m; a value that is not positive and finite means no return.
            intrinsics: intrinsics of the depth image.
            T_grid_camera: pose of ``camera_optical`` in the grid's frame.
            ends: further end points in the grid's frame, m.

        Raises:
            InputError: the box of marks alone exceeds the map's memory limit; :meth:`trace` raises this error, too.
        """
        config, size, far = self._config, self._config.voxel_size, self._config.max_range
        pose = T_grid_camera[:3].copy()
        pose[:, 3] /= size
        frustum = intrinsics.frustum * (far / size)
        scan = self._scan_around(transform_places(pose, frustum))
        mark_ends(ends, T_grid_camera, size, far, scan.lower, scan.marks)
        pose[:, 3] -= scan.lower
        pinhole = np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy])
        pyramid = np.empty(_pyramid_shape(*depth.shape), np.float32)
        limits = size, far, config.margin, NARROW_DEPTH
        mark_depth_image(depth, pinhole, pose, *limits, scan.marks, scan.flat, pyramid)
        return scan

    def trace(self, points: Places, origin: Place) -> Scan:
        """Find the voxels that contain points in range, and the voxels that rays from the origin to the points cross.

        The points, which must be finite, and the origin are in the grid's frame, m.
        """
        size, far = self._config.voxel_size, self._config.max_range
        rays = points - origin
        length = np.linalg.norm(rays, axis=1)
        free = np.maximum(np.minimum(length, far) - self._config.margin, 0)
        stops = origin + rays * np.divide(free, length, out=np.zeros_like(length), where=length > 0)[:, None]
        ends = length <= far
        scan = self._scan_around(np.vstack([origin[None], stops, points[ends]]) / size)
        points, stops, origin = (array / size - scan.lower for array in (points, stops, origin))
        trace_rays(points, stops, ends, origin, scan.marks)
        return scan

    def _scan_around(self, points: NDArray[np.float64]) -> Scan:
        """An empty scan around (N, 3) points in the grid's frame, voxels, with a voxel's margin for rounding."""
        x, y, z, nx, ny, nz = box_around(points, BLOCK)
        size = nx * ny * nz + 1
        if size > self._max_bytes:
            limit = f"the metric map's limit of {self._max_bytes} bytes"
            raise InputError(f"a scan of {size} voxels exceeds {limit}; increase metric_map.max_bytes or voxel_size")
        if size > self._buffer.size:
            self._buffer = np.empty(size, np.uint8)
        flat = self._buffer[:size]
        flat.fill(0)
        return Scan(np.array((x, y, z)), flat[:-1].reshape(nx, ny, nz), flat)


@lru_cache(maxsize=8)
def _pyramid_shape(height: int, width: int) -> tuple[int, int, int]:
    """Numbers of levels, rows and columns of tiles in the pyramid; its last level uses at most 3 × 3 tiles."""
    rows, columns = -(-height // TILE), -(-width // TILE)
    return 1 + max(0, int(np.ceil(np.log2(max(rows, columns) / 3)))), rows, columns
