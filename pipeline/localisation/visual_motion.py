"""The camera's motion between two frames by corners in its images, for where surfaces alone do not determine it."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.frame import Frame
from pipeline.transforms import from_rotation, inverse

MOST_CORNERS, LEAST_QUALITY, CORNER_SPACING = 400, 0.01, 8
"""Greatest number of corners, least quality relative to the strongest, and pixels between two corners."""
PIXEL_ERROR = 2.0
"""Pixels by which a corner may miss where a motion has it, or where it began when it is tracked there and back."""
LEAST_CORNERS = 20
"""Least number of corners that agree on a motion; at least half of all must."""


def visual_motion(before: Frame, after: Frame) -> NDArray[np.float64] | None:
    """4×4 ``T_before_after`` of the camera; None where too few corners agree.

    Corners with depth in the first frame are tracked into the second by optical flow (Lucas and Kanade). RANSAC
    finds the pose that explains their pixels in the second.
    """
    first, second = (cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY) for frame in (before, after))
    corners = cv2.goodFeaturesToTrack(
        first, MOST_CORNERS, LEAST_QUALITY, CORNER_SPACING, mask=before.returns.astype(np.uint8)
    )
    if corners is None or len(corners) < LEAST_CORNERS:
        return None
    there, found = _followed(first, second, corners)
    back, found_back = _followed(second, first, there)
    good = found & found_back & (np.linalg.norm(back - corners, axis=2).ravel() < PIXEL_ERROR)
    if np.count_nonzero(good) < LEAST_CORNERS:
        return None
    columns, rows = np.rint(np.asarray(corners)[good, 0]).astype(int).T
    points = before.intrinsics.rays[rows, columns] * before.depth[rows, columns, None]
    k = after.intrinsics
    K = np.array([[k.fx, 0, k.cx - 0.5], [0, k.fy, k.cy - 0.5], [0, 0, 1]])
    ok, turn, way, inliers = cv2.solvePnPRansac(
        points.astype(np.float64), there[good].astype(np.float64), K, None, reprojectionError=PIXEL_ERROR
    )
    if not ok or inliers is None or len(inliers) < max(LEAST_CORNERS, np.count_nonzero(good) / 2):
        return None
    return inverse(from_rotation(Rotation.from_rotvec(turn.ravel()).as_matrix(), way.ravel()))


def _followed(before: NDArray, after: NDArray, corners: NDArray) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where corners (N, 1, 2) of one grey image are in another, and (N,) whether they were found."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.zeros_like(corners))
    return np.asarray(there, np.float32), np.asarray(found).ravel() > 0
