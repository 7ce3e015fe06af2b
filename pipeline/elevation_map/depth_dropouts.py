"""Depth dropouts: ground that a frame ought to have shown and did not.

A thin upright panel seen along its plane gives no returns: its face is seen at a grazing angle, and its end may be
nearer than the camera's range. Its only trace is a stripe of the image without ground between ground.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.elevation_map import depth_dropouts_kernels as kernels
from pipeline.elevation_map.elevation_kernels import MIN_HITS
from pipeline.frame import Intrinsics
from pipeline.sensor import SensorModel
from pipeline.transforms import transform_points


def find_depth_dropouts(
    depth: NDArray[np.float32], intrinsics: Intrinsics, T_map_camera: NDArray[np.float64], sensor: SensorModel
) -> NDArray[np.float32]:
    """(N, 3) float32 points in ``map`` where rays should have met the ground that is seen on both sides of them.

    Args:
        depth: (H, W) float32 m along the optical axis; 0 = no return.
        intrinsics: of the depth image.
        T_map_camera: pose of ``camera_optical``.
        sensor: that measured the depth.
    """
    dropouts = np.zeros_like(depth)
    kernels.dropout_depth(depth, intrinsics.fy, sensor.grazing, dropouts)
    gaps, _ = ndimage.label(dropouts[:: kernels.ROW_STEP] > 0, np.ones((3, 3)))
    is_panel = [False, *(rows.stop - rows.start >= MIN_HITS for rows, _ in ndimage.find_objects(gaps))]
    v, u = np.nonzero(np.array(is_panel)[gaps])
    v *= kernels.ROW_STEP
    return transform_points(T_map_camera, intrinsics.rays[v, u] * dropouts[v, u, None])
