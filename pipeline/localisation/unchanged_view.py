"""Detection of wheels that spin on the spot, from a view that stays the same although the wheels turn."""

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.frame import Frame
from pipeline.transforms import inverse

MIN_DISTANCE = 0.05
"""Minimum distance that the wheels must have measured for the view to be compared, m."""
REDUCED_SIZE = 80, 60
"""Width and height, pixels, to which images are reduced, so that their noise averages out."""
DIFFERENCE_QUANTILE = 0.95
"""Quantile of the absolute differences of pixels by which two images are compared."""
MAX_GREY_DIFFERENCE = 1.2
"""Maximum difference between two images of one view, grey levels. While the wheels of a wedged robot spun, the
difference was 1; in all but one of 2,300 motions of 0.3 m, it was at least 2."""
MAX_DEPTH_DIFFERENCE = 0.05
"""Maximum difference between two depth images of one view, m."""


def shows_no_motion(before: Frame, after: Frame) -> bool:
    """Whether the view is the same although the wheels measured a motion that would have changed it.

    False in front of a plain wall, which looks the same after a motion, too.
    """
    moved = inverse(before.T_odom_base) @ after.T_odom_base
    if np.linalg.norm(moved[:3, 3]) < MIN_DISTANCE or before.rgb.shape != after.rgb.shape or not after.rgb.size:
        return False
    old, new = (_reduced(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)) for frame in (before, after))
    depths = [_reduced(np.where(frame.returns, frame.depth, 0.0)) for frame in (before, after)]
    is_same = _difference(old, new) < MAX_GREY_DIFFERENCE and _difference(*depths) < MAX_DEPTH_DIFFERENCE
    return is_same and _difference(old, _expected_image(old, before, after, moved)) > 2 * MAX_GREY_DIFFERENCE


def _expected_image(image: NDArray[np.float64], before: Frame, after: Frame, moved: Pose) -> NDArray[np.float64]:
    """The earlier image as it would look after a motion of the robot, from the homography of the scene.

    The scene is assumed to be a plane perpendicular to the optical axis, at the median depth of the returns or,
    without returns, at the nearest measurable depth.
    """
    T = inverse(moved @ after.T_base_camera) @ before.T_base_camera
    returns = before.depth[before.returns]
    away = float(np.median(returns)) if returns.size else before.sensor.nearest
    k = before.intrinsics
    K = np.diag([REDUCED_SIZE[0] / k.width, REDUCED_SIZE[1] / k.height, 1.0]) @ k.matrix
    plane = T[:3, :3] + np.outer(T[:3, 3], [0.0, 0.0, 1.0 / away])
    homography = K @ plane @ np.linalg.inv(K)
    return np.asarray(cv2.warpPerspective(image, homography, REDUCED_SIZE, borderMode=cv2.BORDER_REPLICATE))


def _reduced(image: NDArray[np.generic]) -> NDArray[np.float64]:
    return np.asarray(cv2.resize(image.astype(np.float64), REDUCED_SIZE, interpolation=cv2.INTER_AREA))


def _difference(before: NDArray[np.float64], after: NDArray[np.float64]) -> float:
    return float(np.quantile(np.abs(after - before), DIFFERENCE_QUANTILE))
