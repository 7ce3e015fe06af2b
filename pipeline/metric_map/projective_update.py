"""From a depth image to the marks of a scan, by projecting voxels into the image instead of following every ray."""

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from pipeline.metric_map import projection_kernels as kernels
from pipeline.metric_map.scan import Scan, Scratch


def project(
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    T_grid_camera: NDArray[np.float64],
    voxel_size: float,
    max_range: float,
    margin: tuple[float, float],
    scratch: Scratch,
) -> Scan:
    """The voxels that the rays of a depth image end in and those that they cross.

    Args:
        depth: (H, W) float32, m along the optical axis; NaN, infinite and non-positive values are no return.
        intrinsics: of the depth image.
        T_grid_camera: 4×4 pose of the camera in the grid's frame, in which voxel (0, 0, 0) starts at the origin.
        voxel_size: m.
        max_range: m of depth; a deeper return frees space up to there and ends nowhere.
        margin: see :class:`MetricMapConfig`.
        scratch: lends the marks, which live until the next call.
    """
    lower, shape = _view(intrinsics, T_grid_camera, voxel_size, max_range)
    flat = scratch.zeros(shape)
    marks = flat[:-1].reshape(shape)
    rotation = np.ascontiguousarray(T_grid_camera[:3, :3])
    camera = T_grid_camera[:3, 3] - lower * voxel_size
    focal, centre = np.array([intrinsics.fx, intrinsics.fy]), np.array([intrinsics.cx, intrinsics.cy])
    low, high = _empty_pyramid(depth.shape)
    kernels.mark_returns(
        depth, max_range, focal, centre, camera, rotation, voxel_size, shape, flat, low[0], high[0]
    )
    kernels.build_pyramid(low, high)
    kernels.mark_free(
        depth, max_range, np.array(margin), focal, centre, camera, rotation, voxel_size, marks, low, high
    )
    return Scan(lower, marks)


def _view(
    intrinsics: Intrinsics, T_grid_camera: NDArray[np.float64], voxel_size: float, max_range: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First voxel and shape of the box around all that the camera can see, with a voxel to spare for rounding."""
    u = (np.array([0, intrinsics.width]) - intrinsics.cx) / intrinsics.fx
    v = (np.array([0, intrinsics.height]) - intrinsics.cy) / intrinsics.fy
    corners = np.array([(0, 0, 0), *((a, b, 1) for a in u for b in v)]) * max_range
    corners = corners @ T_grid_camera[:3, :3].T + T_grid_camera[:3, 3]
    lower = np.floor(corners.min(axis=0) / voxel_size).astype(np.int64) - 1
    upper = np.floor(corners.max(axis=0) / voxel_size).astype(np.int64) + 2
    return lower, upper - lower


def _empty_pyramid(shape: tuple[int, ...]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Least and greatest reach, (levels, H / TILE, W / TILE); the last level has at most 3 × 3 tiles."""
    rows, columns = (-(-side // kernels.TILE) for side in shape)
    levels = 1 + max(0, int(np.ceil(np.log2(max(rows, columns) / 3))))
    return np.empty((levels, rows, columns), np.float32), np.empty((levels, rows, columns), np.float32)
