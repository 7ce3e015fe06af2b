"""From a depth image to the marks of a scan, by projecting voxels into the image instead of following every ray."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from pipeline.metric_map.projection_kernels import TILE, observe
from pipeline.metric_map.scan import Scan, Scratch


def project(
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    T_grid_camera: NDArray[np.float64],
    voxel_size: float,
    max_range: float,
    margin: float,
    scratch: Scratch,
) -> Scan:
    """The voxels that the rays of a depth image end in and those that they cross.

    Args:
        depth: (H, W) float32, m along the optical axis; NaN, infinite and non-positive values are no return.
        intrinsics: of the depth image.
        T_grid_camera: 4×4 pose of the camera in the grid's frame, in which voxel (0, 0, 0) starts at the origin.
        voxel_size: m.
        max_range: m of depth; a deeper return frees space up to there and ends nowhere.
        margin: m of depth before its end up to which a ray frees space.
        scratch: lends the marks.
    """
    pose = T_grid_camera[:3].copy()
    pose[:, 3] /= voxel_size
    view = _view(intrinsics) * (max_range / voxel_size)
    scan = scratch.scan_around(view @ pose[:, :3].T + pose[:, 3])
    pose[:, 3] -= scan.lower
    pinhole = np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy])
    pyramid = np.empty(_pyramid_shape(*depth.shape), np.float32)
    observe(depth, pinhole, pose, voxel_size, max_range, margin, scan.marks, scan.flat, pyramid)
    return scan


@lru_cache(maxsize=8)
def _view(intrinsics: Intrinsics) -> NDArray[np.float64]:
    """(5, 3) corners of all that the camera sees up to 1 m deep, in ``camera_optical``."""
    u = (np.array([0, intrinsics.width]) - intrinsics.cx) / intrinsics.fx
    v = (np.array([0, intrinsics.height]) - intrinsics.cy) / intrinsics.fy
    return np.array([(0, 0, 0), *((a, b, 1) for a in u for b in v)])


@lru_cache(maxsize=8)
def _pyramid_shape(height: int, width: int) -> tuple[int, int, int]:
    """Levels, rows and columns of the pyramid's tiles; of the last level at most 3 × 3 are used."""
    rows, columns = -(-height // TILE), -(-width // TILE)
    return 1 + max(0, int(np.ceil(np.log2(max(rows, columns) / 3)))), rows, columns
