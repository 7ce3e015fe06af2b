"""Estimate the vertical from the surfaces that a camera sees, for recordings that do not contain it otherwise.

Floors and tables are horizontal, walls and cupboards vertical. Method: S. Gupta, P. Arbeláez and J. Malik,
"Perceptual Organization and Recognition of Indoor Scenes from RGB-D Images", CVPR 2013.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.localisation.floor import LEAST_FLOOR, MOST_BELOW, T_level_camera
from pipeline.localisation.registration import front_normals
from pipeline.localisation.slam import cloud_of_frame


def vertical(frame: Frame) -> NDArray[np.float64] | None:
    """(3,) the vertical in ``base_link``, by surfaces about level or upright in the image; None if they do not tell.

    A wall alone does not: at least LEAST_FLOOR of the surfaces must tell the vertical from other directions.
    """
    cloud = cloud_of_frame(frame)
    if cloud is None:
        return None
    normals = front_normals(cloud, frame.T_base_camera[:3, 3])
    up = -frame.T_base_camera[:3, 1]
    # Within so much of horizontal and of vertical surfaces count, round by round, as published.
    for angle in np.repeat(np.deg2rad([45, 15]), 5):
        along = np.abs(normals @ up)
        level, upright = normals[along > np.cos(angle)], normals[along < np.sin(angle)]
        values, directions = np.linalg.eigh(upright.T @ upright - level.T @ level)
        if values[1] - values[0] < LEAST_FLOOR * len(normals):
            return None
        up = directions[:, 0] * np.sign(directions[:, 0] @ up)
    return up


def T_lowest_camera(frame: Frame, up: NDArray[np.float64]) -> NDArray[np.float64]:
    """4×4 pose of the camera over the lowest that it sees, as :func:`T_level_camera`.

    Args:
        frame: with its depth.
        up: (3,) the vertical in ``camera_optical``, of length 1.
    """
    heights = (frame.intrinsics.rays[frame.returns] @ up) * frame.depth[frame.returns]
    return T_level_camera(up, float(np.quantile(heights, MOST_BELOW)))
