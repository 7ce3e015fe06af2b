"""The point cloud of a frame for registration."""

import cv2
import numpy as np
import small_gicp

from pipeline.frame import Frame
from pipeline.localisation.config import RegistrationConfig
from pipeline.localisation.registration import cloud_of
from pipeline.transforms import transform_points


def cloud_of_frame(frame: Frame, config: RegistrationConfig) -> small_gicp.PointCloud | None:
    """The frame's returns in ``base_link``, thinned and with normals; None if there are too few."""
    returns = frame.returns[::2, ::2]
    depth = np.where(returns, frame.depth[::2, ::2], 0)
    farthest = frame.sensor.farthest
    farthest_around = cv2.dilate(depth, np.ones((config.limit_pixels, config.limit_pixels)))
    returns = returns & (farthest_around < farthest - frame.sensor.sigma(farthest))
    if np.count_nonzero(returns) < config.min_points:
        return None
    points = frame.intrinsics.rays[::2, ::2][returns] * depth[returns, None]
    cloud = cloud_of(transform_points(frame.T_base_camera, points), config)
    return cloud if cloud.size() >= config.min_points else None
