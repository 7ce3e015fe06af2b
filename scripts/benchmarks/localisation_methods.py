"""The methods in the localisation benchmark: ours, and baselines that start at the first true pose."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial

import numpy as np
import open3d as o3d
from kiss_icp.config import KISSConfig
from kiss_icp.config.config import AdaptiveThresholdConfig, DataConfig, MappingConfig, RegistrationConfig
from kiss_icp.kiss_icp import KissICP
from numpy.typing import NDArray

from pipeline.arrays import Pose, Poses
from pipeline.frame import Frame, Intrinsics
from pipeline.localisation.slam import Slam
from pipeline.sensor import XTION
from pipeline.transforms import inverse, orthonormal, transform_points
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.robots.model import robot_model
from sarsim.scoring.trajectory import is_false
from scripts.benchmarks.localisation_scores import errors_of, moved_along, nees, trajectory_scores, within

STRIDE = 4
"""Pixel stride of the points given to KISS-ICP.

The points are still denser than the voxels to which KISS-ICP downsamples a scan, each of which keeps one point.
"""

MIN_RETURNS = 0.1
"""Minimum fraction of pixels with returns; with fewer returns, such as near a wall, baselines get lost."""
MAX_DEVIATION = 0.1, np.deg2rad(5)
"""m and rad; a baseline that deviates more from the odometry within a frame is lost, and the odometry is used."""

CORRECTION_INTERVAL = 3  # Keyframes between two of our corrections, as between two steps of an episode

RgbdImage = o3d.t.geometry.RGBDImage


def is_blind(frame: Frame) -> bool:
    """Whether a frame has too few returns to be registered."""
    return bool(np.mean(frame.returns) < MIN_RETURNS)


class Method(ABC):
    """Estimates poses along a drive, frame by frame."""

    @abstractmethod
    def localise(self, frame: Frame) -> Pose:
        """The pose of ``base_link`` in ``map`` at the next frame."""

    def corrected(self, online: NDArray[np.float64]) -> Poses:
        """Final estimates of all poses, given the ``online`` estimates made during the drive."""
        return online

    def report(self, true: NDArray[np.float64], online: NDArray[np.float64]) -> dict[str, float]:
        """Further figures of the method, from (N, 4, 4) true poses and the online estimates."""
        return {}


class Ours(Method):
    """The robot's own localisation, with keyframes chosen as in exploration."""

    def __init__(self, T_map_start: Pose, loops: bool = True):
        self._slam = Slam(loops)
        self._mapper = make_mapper(TRUE_LABELS, robot_model(), localisation=self._slam)
        self._keyframes: list[int] = []
        self._corrections: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = []
        self._frames = 0
        self._keyframe_s: list[float] = []

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """Localise a frame, make it a keyframe if one is due, and correct the poses at every few keyframes."""
        timed = self._mapper.stopwatch.seconds["localisation"]
        before, is_due = len(timed), self._mapper.is_due(frame.T_odom_base)
        localised = self._mapper.localise(frame)
        if is_due and self._mapper.add_if_new(localised, labelled=False):
            if not is_blind(frame):
                self._keyframe_s.append(sum(timed[before:]))
            self._keyframes.append(self._frames)
            if len(self._keyframes) % CORRECTION_INTERVAL == 0:
                self._mapper.apply_corrections()
                self._corrections.append((self._frames, self._slam.poses[-1], self._slam.covariance))
        self._frames += 1
        return localised.T_map_base

    def corrected(self, online: NDArray[np.float64]) -> NDArray[np.float64]:
        """The online poses, each moved along with the correction of the latest keyframe before it."""
        self._mapper.apply_corrections()
        return moved_along(online, self._keyframes, self._slam.poses)

    def report(self, true: NDArray[np.float64], online: NDArray[np.float64]) -> dict[str, float]:
        """Times of keyframes and corrections, loops, the online ATE, and the consistency of the covariances.

        At every correction, the error of the newest pose is compared with the covariance from the pose graph.
        """
        poses, loops = true[self._keyframes], self._slam.loops
        report = {
            "keyframes": float(len(poses)),
            "keyframe_ms": 1e3 * float(np.median(self._keyframe_s)),
            "correction_ms": 1e3 * float(np.median(self._mapper.stopwatch.seconds["pose_graph"])),
            "online_ate_m": trajectory_scores(true, online)["ate_m"],
            "loops": float(len(loops)),
            "false_loops": float(sum(is_false(loop, poses[loop.first], poses[loop.second]) for loop in loops)),
        }
        if self._corrections:
            frames, estimated, covariances = map(np.array, zip(*self._corrections, strict=True))
            errors = errors_of(true[frames], estimated)
            report["nees"], report["within_3_sigma"] = nees(errors, covariances), within(3, errors, covariances)
        return report


class Odometry(Method):
    """Odometry of wheels and gyro alone."""

    def __init__(self, T_map_start: Pose):
        pass

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """The frame's odometry pose."""
        return frame.T_odom_base


class Guided(Method):
    """A baseline that corrects the odometry's motion since the last frame if it can register the frame."""

    def __init__(self, T_map_start: Pose):
        self._T_map_base = T_map_start
        self._last: Frame | None = None

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """Register the frame; use the odometry's motion if the frame has too few returns or registration fails."""
        last, self._last = self._last, frame
        moved = inverse(last.T_odom_base) @ frame.T_odom_base if last else np.eye(4)
        guess = orthonormal(self._T_map_base @ moved)  # KISS-ICP aborts if a rotation is not orthonormal
        found = guess if is_blind(frame) else self._register(frame, last, guess)
        E = inverse(guess) @ found
        is_lost = not (
            np.linalg.norm(E[:3, 3]) < MAX_DEVIATION[0] and np.trace(E[:3, :3]) > 1 + 2 * np.cos(MAX_DEVIATION[1])
        )
        self._T_map_base = guess if is_lost else found
        return self._T_map_base

    @abstractmethod
    def _register(self, frame: Frame, last: Frame | None, guess: NDArray[np.float64]) -> Pose:
        """Pose of ``base_link`` in ``map`` at a frame; ``_T_map_base`` is the pose at the last frame."""


class Kiss(Guided):
    """KISS-ICP (Vizzo et al., RA-L 2023)."""

    VOXEL, POINTS, THRESHOLD = 0.1, 20, 0.02

    def __init__(self, T_map_start: Pose):
        super().__init__(T_map_start)
        config = KISSConfig(
            data=DataConfig(max_range=1.5 * XTION.farthest, min_range=XTION.nearest / 2, deskew=False),
            mapping=MappingConfig(voxel_size=self.VOXEL, max_points_per_voxel=self.POINTS),
            registration=RegistrationConfig(max_num_threads=1),
            adaptive_threshold=AdaptiveThresholdConfig(fixed_threshold=self.THRESHOLD),
        )
        self._kiss = KissICP(config)

    def _register(self, frame: Frame, last: Frame | None, guess: NDArray[np.float64]) -> NDArray[np.float64]:
        """Register the frame to the local map."""
        depth, rays = frame.depth[::STRIDE, ::STRIDE], frame.intrinsics.rays[::STRIDE, ::STRIDE]
        points = transform_points(frame.T_base_camera, rays[depth > 0] * depth[depth > 0, None])
        self._kiss.last_pose, self._kiss.last_delta = guess, np.eye(4)
        self._kiss.register_frame(points.astype(np.float64), np.zeros(0))
        return self._kiss.last_pose


class Open3d(Guided):
    """Open3D's frame-to-frame RGB-D odometry (Park, Zhou and Koltun, ICCV 2017)."""

    def __init__(self, T_map_start: Pose):
        super().__init__(T_map_start)
        self._image: tuple[Frame | None, RgbdImage | None] = None, None

    def _register(self, frame: Frame, last: Frame | None, guess: NDArray[np.float64]) -> NDArray[np.float64]:
        """Register the frame to the last frame, unless the last frame had too few returns."""
        colour, depth = (o3d.t.geometry.Image(np.ascontiguousarray(image)) for image in (frame.rgb, frame.depth))
        image = RgbdImage(colour, depth)
        (seen, target), self._image = self._image, (frame, image)
        if last is None or seen is not last:
            return guess
        T_map_camera = self._T_map_base @ last.T_base_camera
        T = self._motion(image, target, frame.intrinsics, inverse(T_map_camera) @ guess @ frame.T_base_camera)
        return T_map_camera @ T @ inverse(frame.T_base_camera)

    def _motion(self, source: RgbdImage, target: RgbdImage | None, k: Intrinsics, guess: NDArray[np.float64]) -> Pose:
        """Pose of the source camera in the target camera's frame; the guess if Open3D fails."""
        # Open3D has pixel centres at integer coordinates.
        try:
            result = o3d.t.pipelines.odometry.rgbd_odometry_multi_scale(
                source,
                target,
                o3d.core.Tensor.from_numpy(k.matrix),
                o3d.core.Tensor.from_numpy(guess),
                depth_scale=1.0,
                depth_max=XTION.farthest,
                method=o3d.t.pipelines.odometry.Method.Hybrid,
            )
        except RuntimeError:  # too little overlap
            return guess
        return result.transformation.numpy()


METHODS: dict[str, Callable[[NDArray[np.float64]], Method]] = {
    "ours": Ours,
    "ours_without_loops": partial(Ours, loops=False),
    "odometry": Odometry,
    "kiss_icp": Kiss,
    "open3d": Open3d,
}
"""Constructors of the methods, each called with the first pose, a 4×4 ``T_map_base``."""
