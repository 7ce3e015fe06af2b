"""From a point cloud with an origin to the marks of a scan, by following every ray."""

import numpy as np
from numpy.typing import NDArray

from pipeline.metric_map.ray_kernels import trace_points
from pipeline.metric_map.scan import Scan, Scratch


def trace(
    points: NDArray[np.float64],
    origin: NDArray[np.float64],
    voxel_size: float,
    max_range: float,
    margin: float,
    scratch: Scratch,
) -> Scan:
    """The voxels that points fall in and those that the rays to them cross.

    Args:
        points: (N, 3) float64, finite, in the grid's frame, in which voxel (0, 0, 0) starts at the origin.
        origin: (3,) float64, where the sensor stood, in the same frame.
        voxel_size: m.
        max_range: m from the origin; a farther point frees space up to there and ends nowhere.
        margin: m before its end up to which a ray frees space.
        scratch: lends the marks.
    """
    rays = points - origin
    length = np.linalg.norm(rays, axis=1)
    free = np.maximum(np.minimum(length, max_range) - margin, 0)
    stops = origin + rays * np.divide(free, length, out=np.zeros_like(length), where=length > 0)[:, None]
    ends = length <= max_range
    scan = scratch.scan_around(np.vstack([origin[None], stops, points[ends]]) / voxel_size)
    points, stops, origin = (array / voxel_size - scan.lower for array in (points, stops, origin))
    trace_points(points, stops, ends, origin, scan.marks)
    return scan
