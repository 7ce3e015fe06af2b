"""The robot's 3D occupancy grid (thesis 3.1): a 3D array that says of every voxel whether it is free."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.metric_map import files
from pipeline.metric_map.blocks import BlockArray, parts
from pipeline.metric_map.grid_kernels import WORD, any_mark, fold
from pipeline.metric_map.projective_update import project
from pipeline.metric_map.ray_traversal import trace
from pipeline.metric_map.scan import Scan, Scratch

OCCUPIED, UNKNOWN, FREE = 0.0, 0.5, 1.0
"""The thesis's three values of a voxel."""

_IDENTITY = np.eye(3)

FARTHEST = 1e5
"""m; a pose or point farther from the map's origin than this is taken for an error."""


@dataclass(frozen=True)
class MetricMapConfig:
    """How the metric map is laid out and how it weighs what the camera sees.

    Attributes:
        voxel_size: m.
        max_range: m; returns from farther free space up to here and end nowhere. Along the optical axis for depth
            images, from the origin for points.
        offset: (x, y, z) of a voxel's corner in ``map``, in voxels. Built surfaces tend to lie at round figures;
            noise makes one that lies on a face between two voxel layers fill both. So z = 0 is put inside a layer,
            and so are the multiples of half a voxel along every axis.
        hit: what an end point adds to a voxel's log-odds. Far more than a crossing takes: one return proves a
            surface, while rays cross a voxel with a surface in a corner of it again and again.
        miss: what a crossing takes from a voxel's log-odds.
        least: the lower clamp. One hit must outweigh it.
        greatest: the upper clamp; a surface that has gone vanishes after (greatest / miss) looks.
        margin: (a, b); a ray frees space up to a + b · depth² m before its end, which keeps noise from freeing what
            lies just behind the surface. The noise of triangulation grows with depth².
        max_bytes: the most memory that voxels may take.
    """

    voxel_size: float = 0.1
    max_range: float = 3.5
    offset: tuple[float, float, float] = (-0.25, -0.25, -0.4)
    hit: int = 40
    miss: int = 2
    least: int = -30
    greatest: int = 120
    margin: tuple[float, float] = (0.0, 0.0)
    max_bytes: int = 2**31


class MetricMap:
    """Which voxels of the ``map`` frame are free, occupied or unknown.

    Inside, a voxel is an int8 log-odds value (0 = never seen). Seen from outside it is one of the thesis's three
    values. Every look changes the voxels in view only, so its time does not depend on the size of the environment.
    """

    def __init__(self, config: MetricMapConfig | None = None) -> None:
        self.config = config or MetricMapConfig()
        self._corner = np.array(self.config.offset) * self.config.voxel_size
        self._log_odds = BlockArray(self.config.max_bytes)
        self._scratch = Scratch(self.config.max_bytes)

    def integrate(
        self, depth: NDArray[np.float32], intrinsics: Intrinsics, T_map_camera: NDArray[np.float64]
    ) -> None:
        """Add a depth image.

        Args:
            depth: (H, W) float32, m along the optical axis; NaN, infinite and non-positive values are no return.
            intrinsics: of the depth image.
            T_map_camera: 4×4 pose of ``camera_optical`` in ``map``.

        Raises:
            InputError: if the intrinsics do not fit the image, the pose is not rigid or the map is full.
        """
        _check_image(depth, intrinsics)
        T_grid_camera = _rigid(T_map_camera)
        T_grid_camera[:3, 3] -= self._corner
        config = self.config
        depth = np.ascontiguousarray(depth, np.float32)
        self._fold(
            project(
                depth,
                intrinsics,
                T_grid_camera,
                config.voxel_size,
                config.max_range,
                config.margin,
                self._scratch,
            )
        )

    def integrate_points(self, points: ArrayLike, origin: ArrayLike) -> None:
        """Add a point cloud with the place that it was seen from.

        Args:
            points: (N, 3) m in ``map``; points that are not finite are left out.
            origin: (3,) m in ``map``.

        Raises:
            InputError: if a shape is wrong, the origin is not finite or the map is full.
        """
        cloud, start = _points(points), np.asarray(origin, np.float64)
        if start.shape != (3,) or not np.all(np.abs(start) <= FARTHEST):
            raise InputError(
                "the origin of a point cloud must be three finite numbers within the map's reach"
            )
        cloud = cloud[np.isfinite(cloud).all(axis=1)]
        if cloud.size:
            config = self.config
            cloud, start = cloud - self._corner, start - self._corner
            self._fold(trace(cloud, start, config.voxel_size, config.max_range, config.margin, self._scratch))

    def voxel_index(self, points: ArrayLike) -> NDArray[np.int64]:
        """(N, 3) int64 indices of the voxels that (N, 3) points, m in ``map``, fall in."""
        return np.floor((_points(points) - self._corner) / self.config.voxel_size).astype(np.int64)

    def voxel_centre(self, index: NDArray[np.int64]) -> NDArray[np.float32]:
        """(N, 3) float32 centres, m in ``map``, of the voxels with (N, 3) indices."""
        return ((index + 0.5) * self.config.voxel_size + self._corner).astype(np.float32)

    def bounds(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(3,) first index and (3,) one past the last index of the box around all voxels seen so far."""
        return self._log_odds.bounds()

    def log_odds(self, lower: NDArray[np.int64], upper: NDArray[np.int64]) -> NDArray[np.int8]:
        """A copy of the voxels lower..upper (exclusive): (nx, ny, nz) int8, > 0 occupied, < 0 free, 0 unknown."""
        return self._log_odds.read(lower, tuple((upper - lower).tolist()))

    def state_at(self, points: ArrayLike) -> NDArray[np.float32]:
        """(N,) float32 in {0 occupied, 0.5 unknown, 1 free} at (N, 3) points, m in ``map``."""
        index = self.voxel_index(points)
        if not len(index):
            return np.zeros(0, np.float32)
        lower = index.min(axis=0)
        i, j, k = (index - lower).T
        return _states(self.log_odds(lower, index.max(axis=0) + 1)[i, j, k])

    def array(self) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """The thesis's 3D array of all that was seen so far.

        Returns:
            (nx, ny, nz) float32 in {0 occupied, 0.5 unknown, 1 free}, and (3,) the corner of its first voxel, m in
            ``map``.
        """
        lower, upper = self.bounds()
        return _states(self.log_odds(lower, upper)), lower * self.config.voxel_size + self._corner

    def occupied_centres(self) -> NDArray[np.float32]:
        """(N, 3) float32 centres of the occupied voxels, m in ``map``, sorted by index."""
        return self._centres(OCCUPIED)

    def free_centres(self) -> NDArray[np.float32]:
        """(N, 3) float32 centres of the free voxels, m in ``map``, sorted by index."""
        return self._centres(FREE)

    def save(self, path: Path | str) -> None:
        """Write the map to an ``.npz`` file, see :func:`pipeline.metric_map.files.save_npz`."""
        files.save_npz(path, self)

    @classmethod
    def load(cls, path: Path | str) -> MetricMap:
        """Read a map that :meth:`save` wrote.

        Raises:
            InputError: if the file is missing, damaged or foreign.
        """
        config, lower, log_odds = files.read_npz(path)
        result = cls(MetricMapConfig(**config))
        result._log_odds.write(lower, log_odds)
        return result

    def _centres(self, state: float) -> NDArray[np.float32]:
        lower, upper = self.bounds()
        return self.voxel_centre(np.argwhere(_states(self.log_odds(lower, upper)) == state) + lower)

    def _fold(self, scan: Scan) -> None:
        config, words = self.config, scan.words
        for key, (i, j, k), in_block in parts(scan.lower, scan.marks.shape):
            part = words[i, j, k.start // WORD : k.stop // WORD]
            if key in self._log_odds or any_mark(part):
                log_odds = self._log_odds.block(key)[in_block]
                fold(part, log_odds, config.hit, config.miss, config.least, config.greatest)


def _states(log_odds: NDArray[np.int8]) -> NDArray[np.float32]:
    return np.array((UNKNOWN, OCCUPIED, FREE), np.float32)[np.sign(log_odds)]


def _check_image(depth: NDArray[np.float32], intrinsics: Intrinsics) -> None:
    if depth.shape != (intrinsics.height, intrinsics.width) or not depth.size:
        expected = (intrinsics.height, intrinsics.width)
        raise InputError(f"a depth image of shape {depth.shape} does not fit intrinsics for {expected}")
    if not (0 < intrinsics.fx < np.inf and 0 < intrinsics.fy < np.inf):
        raise InputError(f"focal lengths must be positive, got {intrinsics.fx} and {intrinsics.fy}")
    if not (np.isfinite(intrinsics.cx) and np.isfinite(intrinsics.cy)):
        raise InputError(f"the principal point must be finite, got {intrinsics.cx} and {intrinsics.cy}")


def _rigid(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """A copy of a pose, float64, after making sure that it is one."""
    T = np.array(T, np.float64)
    if T.shape != (4, 4) or T[3].tolist() != [0, 0, 0, 1]:
        raise InputError("a pose must be a 4×4 matrix whose last row is 0 0 0 1")
    R = T[:3, :3]
    # Written so that a NaN anywhere fails too.
    if not (np.abs(R @ R.T - _IDENTITY).max() <= 1e-4 and np.linalg.det(R) > 0):
        raise InputError("a pose must be rigid: its rotation is not orthonormal or mirrors")
    if not np.abs(T[:3, 3]).max() <= FARTHEST:
        raise InputError(f"the camera must stand within {FARTHEST:.0f} m of the map's origin")
    return T


def _points(points: ArrayLike) -> NDArray[np.float64]:
    cloud = np.asarray(points, np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise InputError(f"points must have shape (N, 3), got {cloud.shape}")
    return cloud
