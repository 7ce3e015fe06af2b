"""Odometry from an RGB-D camera alone: each frame is registered with earlier ones, starting from visual odometry."""

from collections.abc import Sequence
from math import radians

import cv2
import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Mask, Pose, Values
from pipeline.frame import Frame
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.frame_cloud import cloud_of_frame
from pipeline.localisation.local_map import LocalMap
from pipeline.localisation.localisation import LostError
from pipeline.localisation.registration import Prior, Registration, Target, evidence_by_keyframe, register
from pipeline.transforms import angle_of, from_rotation, inverse, transform_places

GUESS_SIGMA = 0.15
"""Standard deviation of the next frame's pose about a guess, rad and m."""
IMAGE_ROTATION_SIGMA, IMAGE_TRANSLATION_SIGMA = 0.004, 0.008
"""Standard deviations of the next frame's pose from visual odometry, rad and m; small, because GICP falsely measures
no motion along a plane."""
MIN_OVERLAP = 0.4
"""Minimum fraction of a frame's points that must have been seen before, unless its image shows the motion."""
MAX_BLIND_FRAMES = 30
"""Maximum number of consecutive frames with too few returns to register and no visual odometry; with more, the pose
is lost."""
MIN_KEPT_TRANSLATION, MIN_KEPT_ROTATION = 0.15, radians(7.5)
"""Minimum distance, m, or angle, rad, between frames whose surfaces are kept; small, so that the next frames overlap
with these surfaces."""
MAX_CORNERS, MIN_CORNERS = 400, 20
"""Maximum number of corners to track, and minimum number that must agree on a motion; half of the tracked corners
must agree, too."""
CORNER_QUALITY = 0.01
"""Minimum quality of a corner relative to the strongest."""
CORNER_SPACING = 8
"""Minimum distance between two corners, pixels."""
MAX_PIXEL_ERROR = 2.0
"""Maximum reprojection error of a corner, and maximum error after tracking it to the next image and back, pixels."""


class DepthOdometry:
    """Estimates ``T_odom_base`` of frames; the first pose must be given, with the correct roll and pitch.

    Surfaces stay where they were first seen, so drift accumulates; :class:`pipeline.localisation.slam.Slam` corrects
    it where places are revisited.
    """

    def __init__(self, T_odom_base: Pose, *, config: LocalisationConfig = LocalisationConfig()) -> None:
        """Start at ``T_odom_base``, the pose of the first frame."""
        self._config, self._T, self._motion = config, T_odom_base, np.eye(4)
        self._kept: list[Pose] = []
        self._map = LocalMap(config)
        self._blind_frames = 0
        self._shown: tuple[Frame, Pose] | None = None

    def pose(self, frame: Frame) -> Pose:
        """``T_odom_base`` of the next frame.

        Raises:
            LostError: the frame overlaps too little with earlier ones, or too many consecutive frames have neither
                enough depth nor visual odometry.
        """
        registration = self._config.registration
        cloud, by_image = cloud_of_frame(frame, registration), self._visual_pose(frame)
        if cloud is None:
            self._blind_frames = 0 if by_image is not None else self._blind_frames + 1
            if self._blind_frames > MAX_BLIND_FRAMES:
                found = f"{self._blind_frames} frames in a row had too little depth for registration"
                raise LostError(f"up to {frame.time:.2f} s, {found}")
            self._T = self._T if by_image is None else by_image
            return self._T
        new = np.ones(cloud.size(), np.bool_)
        if self._kept:
            T, target = self._registered_pose(frame, cloud, by_image)
            self._motion = np.eye(4) if self._blind_frames else inverse(self._T) @ T
            self._T = T
            new = evidence_by_keyframe(target, cloud, T, registration)[1] if target else new
        self._blind_frames, self._shown = 0, (frame, self._T)
        moved = inverse(self._kept[-1] if self._kept else self._T) @ self._T
        is_far = np.linalg.norm(moved[:3, 3]) > MIN_KEPT_TRANSLATION or angle_of(moved) > MIN_KEPT_ROTATION
        if not self._kept or is_far:
            self._map.add(len(self._kept), self._T, cloud, frame.T_base_camera[:3, 3], new)
            self._kept.append(self._T)
        return self._T

    def _visual_pose(self, frame: Frame) -> Pose | None:
        """Pose from visual odometry since the last frame that showed surfaces; None if visual odometry fails."""
        if self._shown is None:
            return None
        last, T = self._shown
        motion = visual_motion(last, frame)
        return None if motion is None else T @ last.T_base_camera @ motion @ inverse(frame.T_base_camera)

    def _registered_pose(
        self, frame: Frame, cloud: small_gicp.PointCloud, by_image: Pose | None
    ) -> tuple[Pose, Target | None]:
        """The best-fitting pose and the target of its registration, which is None if the image alone gave the pose.

        Registration starts at the pose from visual odometry, which is kept if no earlier points are near. Without
        visual odometry, or if surfaces contradict it, registration starts both at the last pose and at the pose that
        would follow if the last motion were repeated.
        """
        if by_image is not None:
            sigmas = np.repeat([IMAGE_ROTATION_SIGMA, IMAGE_TRANSLATION_SIGMA], 3)
            seen = self._best_registration(frame, cloud, [by_image], sigmas)
            # Corners in noise or in a repeated pattern may agree on a wrong motion.
            if seen is None or seen[1].fits:
                return (by_image, None) if seen is None else (seen[1].T, seen[0])
        sigmas = np.full(6, GUESS_SIGMA) * (1 + self._blind_frames)
        best = self._best_registration(frame, cloud, [self._T, self._T @ self._motion], sigmas)
        if best is None or best[1].overlap < MIN_OVERLAP:
            raise LostError(f"the frame at {frame.time:.2f} s overlaps earlier frames too little to be registered")
        return best[1].T, best[0]

    def _best_registration(
        self, frame: Frame, cloud: small_gicp.PointCloud, guesses: Sequence[Pose], sigmas: Values
    ) -> tuple[Target, Registration] | None:
        """The target and registration with the most overlap, of one registration per guess; None without a target."""
        points, everyone = cloud.points()[:, :3], np.ones(len(self._kept), np.bool_)
        config, information = self._config.registration, np.diag(sigmas**-2.0)
        found: list[tuple[Target, Registration]] = []
        for T in guesses:
            camera = (T @ frame.T_base_camera)[:3, 3]
            target = self._map.around(transform_places(T, points), camera, everyone, config.widest)
            if target is not None:
                found.append((target, register(target, cloud, [Prior(T, information)], config.widest, config)))
        return max(found, key=lambda pair: pair[1].overlap, default=None)


def visual_motion(before: Frame, after: Frame) -> Pose | None:
    """``T_before_after`` of the camera; None if too few corners agree.

    Corners with depth in the first frame are tracked into the second by optical flow (Lucas and Kanade). PnP with
    RANSAC finds the pose that explains their pixels in the second frame.
    """
    first, second = (cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY) for frame in (before, after))
    corners = cv2.goodFeaturesToTrack(
        first, MAX_CORNERS, CORNER_QUALITY, CORNER_SPACING, mask=before.returns.astype(np.uint8)
    )
    if corners is None or len(corners) < MIN_CORNERS:
        return None
    there, found = _tracked(first, second, corners)
    back, found_back = _tracked(second, first, there)
    good = found & found_back & (np.linalg.norm(back - corners, axis=2).ravel() < MAX_PIXEL_ERROR)
    if np.count_nonzero(good) < MIN_CORNERS:
        return None
    columns, rows = np.rint(np.asarray(corners)[good, 0]).astype(int).T
    points = before.intrinsics.rays[rows, columns] * before.depth[rows, columns, None]
    ok, turn, way, inliers = cv2.solvePnPRansac(
        points.astype(np.float64),
        there[good].astype(np.float64),
        after.intrinsics.matrix,
        None,
        reprojectionError=MAX_PIXEL_ERROR,
    )
    if not ok or inliers is None or len(inliers) < max(MIN_CORNERS, np.count_nonzero(good) / 2):
        return None
    return inverse(from_rotation(Rotation.from_rotvec(turn.ravel()).as_matrix(), way.ravel()))


def _tracked(before: NDArray, after: NDArray, corners: NDArray) -> tuple[NDArray[np.float32], Mask]:
    """Positions of one grey image's corners (N, 1, 2) in another image, and whether each was found."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.zeros_like(corners))
    return np.asarray(there, np.float32), np.asarray(found).ravel() > 0
