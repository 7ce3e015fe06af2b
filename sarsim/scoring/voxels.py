"""Accuracy of the metric map."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.metric_map.metric_map import MetricMap
from sarsim.scoring.voxel_kernels import box_of, mark_rays


class VoxelScore:
    """Collects the voxels that noise-free rays from true poses cross and end in, and compares the map with them."""

    def __init__(self, metric_map: MetricMap):
        self._map = metric_map
        self._loaded = metric_map.occupied_centres()
        self._size = metric_map.voxel_size
        self._corner = metric_map.voxel_centre(np.zeros((1, 3), np.int64))[0].astype(np.float64) - self._size / 2
        self._lower = np.zeros(3, np.int64)
        self._crossed = np.zeros((0, 0, 0), np.bool_)
        self._surface = np.zeros((0, 0, 0), np.bool_)

    def add(self, points: NDArray[np.float32], camera: NDArray[np.float64]) -> None:
        """Trace the noise-free rays of a frame: (N, 3) end points and (3,) camera, m in the world."""
        if not len(points):
            return
        self._reserve(*box_of(points, camera, self._corner, self._size))
        mark_rays(points, camera, self._corner, self._size, self._lower, self._crossed, self._surface)

    def report(self) -> dict[str, float]:
        """The figures of the map; empty if nothing was seen.

        A voxel with a surface counts as surface even if other rays cross it.
        """
        if not self._surface.any():
            return {}
        upper = self._lower + self._surface.shape
        log_odds = self._map.log_odds(self._lower, upper)
        occupied, free = log_odds > 0, log_odds < 0
        crossed = self._crossed & ~self._surface
        near_surface = ndimage.binary_dilation(self._surface, np.ones((3, 3, 3)))
        # Occupied voxels outside the window are wrong, too, except those of an earlier episode that no ray reached.
        loaded = np.floor((self._loaded - self._corner) / self._size).astype(np.int64) - self._lower
        within = loaded[((loaded >= 0) & (loaded < occupied.shape)).all(axis=1)]
        reached = np.count_nonzero((near_surface | self._crossed)[tuple(within.T)])
        all_occupied = max(len(self._map.occupied_centres()) - (len(loaded) - reached), 1)
        return {
            "occupied_recall": float(occupied[self._surface].mean()),
            "occupied_precision": float((occupied & near_surface).sum() / all_occupied),
            "false_free_rate": float(free[self._surface].mean()),
            "free_recall": float(free[crossed].mean()),
        }

    def _reserve(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        """Make room for the voxels from ``low`` (3,) up to, but excluding, ``high`` (3,)."""
        if self._surface.size == 0:
            self._lower = low
        before = np.maximum(self._lower - low, 0)
        after = np.maximum(high - (self._lower + self._surface.shape), 0)
        if before.any() or after.any():
            pad = list(zip(before, after, strict=True))
            self._crossed, self._surface = np.pad(self._crossed, pad), np.pad(self._surface, pad)
            self._lower = self._lower - before
