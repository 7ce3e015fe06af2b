"""Depth dropouts: ground that a frame should have shown but did not.

A thin upright panel seen edge-on gives no returns: its face is seen at a grazing angle, and its end may be too close
to the camera. Its only trace is a stripe without ground in the image, with ground on both sides.
"""

import numpy as np
from scipy import ndimage

from pipeline.arrays import Depth, Points, Pose
from pipeline.elevation_map import depth_dropouts_kernels as kernels
from pipeline.elevation_map.config import DropoutConfig
from pipeline.frame import Intrinsics
from pipeline.sensor import SensorModel
from pipeline.transforms import transform_points


def find_depth_dropouts(
    depth: Depth, intrinsics: Intrinsics, T_target_camera: Pose, sensor: SensorModel, config: DropoutConfig
) -> Points:
    """The points, in the target frame, where rays should have met the ground that is seen on both sides of them."""
    dropouts, fewest, step = np.zeros_like(depth), config.fewest, config.row_step
    same_surface = np.float32(sensor.same_surface)
    kernels.dropout_depth(depth, intrinsics.fy, sensor.grazing, same_surface, fewest, config.widest, step, dropouts)
    gaps, _ = ndimage.label(dropouts[::step] > 0, np.ones((3, 3)))
    is_panel = [False, *(rows.stop - rows.start >= fewest for rows, _ in ndimage.find_objects(gaps))]
    v, u = np.nonzero(np.array(is_panel)[gaps])
    v *= step
    return transform_points(T_target_camera, intrinsics.rays[v, u] * dropouts[v, u, None])
