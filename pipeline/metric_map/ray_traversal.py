"""From a point cloud with an origin to the marks of a scan, by following every ray."""

import numpy as np
from numpy.typing import NDArray

from pipeline.metric_map import ray_kernels as kernels
from pipeline.metric_map.scan import Scan, Scratch


def trace(
    points: NDArray[np.float64],
    origin: NDArray[np.float64],
    voxel_size: float,
    max_range: float,
    margin: tuple[float, float],
    scratch: Scratch,
) -> Scan:
    """The voxels that points fall in and those that the rays to them cross.

    Args:
        points: (N, 3) float64, finite, in the grid's frame, in which voxel (0, 0, 0) starts at the origin.
        origin: (3,) float64, where the sensor stood, in the same frame.
        voxel_size: m.
        max_range: m from the origin; a farther point frees space up to there and ends nowhere.
        margin: see :class:`MetricMapConfig`.
        scratch: lends the marks, which live until the next call.
    """
    rays = points - origin
    length = np.linalg.norm(rays, axis=1)
    reach = np.minimum(length, max_range)
    free_length = np.maximum(reach - margin[0] - margin[1] * reach**2, 0)
    scale = np.divide(free_length, length, out=np.zeros_like(length), where=length > 0)
    stops = origin + rays * scale[:, None]
    ends = length <= max_range
    lower, shape = _box(np.vstack([origin[None], stops, points[ends]]), voxel_size)
    marks = scratch.zeros(shape)[:-1].reshape(shape)
    corner = lower * voxel_size
    kernels.mark_end_points(points - corner, ends, voxel_size, marks)
    kernels.mark_rays(stops - corner, origin - corner, voxel_size, marks)
    return Scan(lower, marks)


def _box(points: NDArray[np.float64], voxel_size: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First voxel and shape of the box around all points, with a voxel to spare for rounding."""
    lower = np.floor(points.min(axis=0) / voxel_size).astype(np.int64) - 1
    upper = np.floor(points.max(axis=0) / voxel_size).astype(np.int64) + 2
    return lower, upper - lower
