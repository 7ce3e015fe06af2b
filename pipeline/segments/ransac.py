"""The best plane among random samples (Fischler & Bolles 1981), by Open3D."""

import numpy as np
from numpy.typing import NDArray


def plane_inliers(
    points: NDArray[np.float32], max_distance: float, samples: int, seed: int
) -> NDArray[np.bool_]:
    """Which points lie near the plane that has most of them near it; the same for the same seed, bit for bit.

    Open3D must try all samples, hence the probability of 1. With less it stops early, sooner or later by the timing
    of its threads, and the result varies with it.

    Args:
        points: (N, 3) float32, N ≥ 3.
        max_distance: m, from the plane.
        samples: number of random planes.
        seed: of the samples; it seeds Open3D as a whole.

    Returns:
        (N,) bool.
    """
    import open3d as o3d  # it takes a second, which no command's --help should

    o3d.utility.random.seed(seed)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
    (*normal, minus_offset), _ = cloud.segment_plane(max_distance, 3, samples, probability=1.0)
    return np.abs(points @ np.array(normal) + minus_offset) < max_distance
