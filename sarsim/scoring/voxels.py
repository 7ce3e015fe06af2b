"""Accuracy of the metric map."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.geometry.ray_kernels import FREE, HIT, trace_rays
from pipeline.metric_map.grid_kernels import box_around
from pipeline.metric_map.metric_map import MetricMap


class VoxelScore:
    """Collects the voxels that noise-free rays from true poses cross or hit, and compares the map with them."""

    def __init__(self, metric_map: MetricMap):
        self._map = metric_map
        self._loaded = metric_map.occupied_centres()
        self._size = metric_map.voxel_size
        self._corner = metric_map.voxel_centre(np.zeros((1, 3), np.int64))[0].astype(np.float64) - self._size / 2
        self._lower = np.zeros(3, np.int64)
        self._marks = np.zeros((0, 0, 0), np.uint8)

    def add(self, points: NDArray[np.float32], camera: NDArray[np.float64]) -> None:
        """Trace the noise-free rays of a frame, from the camera's position (3,) to points (N, 3), m in ``world``."""
        if not len(points):
            return
        ends, start = points - self._corner, (camera - self._corner) / self._size
        ends /= self._size
        for places in (ends, start[None]):
            x, y, z, nx, ny, nz = box_around(places, 1)
            self._reserve(np.array([x, y, z]), np.array([x + nx, y + ny, z + nz]))
        ends -= self._lower
        trace_rays(ends, ends, np.ones(len(ends), np.bool_), start - self._lower, self._marks)

    def report(self) -> dict[str, float]:
        """The figures of the map; empty if nothing was seen.

        A voxel that a ray hits contains a surface even if other rays cross it.
        """
        surface, crossed = self._marks == HIT, self._marks == FREE
        if not surface.any():
            return {}
        log_odds = self._map.log_odds(self._lower, self._lower + surface.shape)
        occupied, free = log_odds > 0, log_odds < 0
        near_surface = ndimage.binary_dilation(surface, np.ones((3, 3, 3)))
        # Occupied voxels outside the window are also wrong, except those of an earlier episode that no ray reached.
        loaded = np.floor((self._loaded - self._corner) / self._size).astype(np.int64) - self._lower
        within = loaded[((loaded >= 0) & (loaded < occupied.shape)).all(axis=1)]
        reached = np.count_nonzero((near_surface | crossed)[tuple(within.T)])
        all_occupied = max(len(self._map.occupied_centres()) - (len(loaded) - reached), 1)
        return {
            "occupied_recall": float(occupied[surface].mean()),
            "occupied_precision": float((occupied & near_surface).sum() / all_occupied),
            "false_free_rate": float(free[surface].mean()),
            "free_recall": float(free[crossed].mean()),
        }

    def _reserve(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        """Make room for the voxels from ``low`` (3,) up to, but excluding, ``high`` (3,)."""
        if self._marks.size == 0:
            self._lower = low
        before = np.maximum(self._lower - low, 0)
        after = np.maximum(high - (self._lower + self._marks.shape), 0)
        if before.any() or after.any():
            self._marks = np.pad(self._marks, list(zip(before, after, strict=True)))
            self._lower = self._lower - before
