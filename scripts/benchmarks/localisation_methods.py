"""What localises a robot in the localisation's benchmark: ours, and peers that are told the first true pose."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from time import process_time

import numpy as np
import open3d as o3d
from kiss_icp.config import KISSConfig
from kiss_icp.config.config import AdaptiveThresholdConfig, DataConfig, MappingConfig, RegistrationConfig
from kiss_icp.kiss_icp import KissICP
from numpy.typing import NDArray

from pipeline.frame import Frame, Intrinsics
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.transforms import inverse, transform_points
from sarsim.robots.pioneer3at import PIONEER_3AT
from sarsim.scripts.benchmarks.localisation_scores import trajectory_scores

STRIDE = 4
"""Pixels between the points that KISS-ICP is given: they lie closer than the voxels of which it keeps one each."""


class Method(ABC):
    """Follows a drive frame by frame."""

    @abstractmethod
    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` when the next frame was taken."""

    def corrected(self, online: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 4, 4) what the method believes in the end of the poses that it told on the way."""
        return online

    def report(self, true: NDArray[np.float64], online: NDArray[np.float64]) -> dict[str, float]:
        """What else there is to say of it, beside (N, 4, 4) true poses and those that it told on the way."""
        return {}


class Ours(Method):
    """The robot's own localisation."""

    def __init__(self, T_map_start: NDArray[np.float64], loops: bool = True):
        self._localisation = OdometryLocalisation()
        self._keyframes: list[int] = []
        self._seconds: list[float] = []
        self._frames = 0

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """Localise, and make a keyframe of what the localisation wants."""
        start = process_time()
        T_map_base = self._localisation.localise(frame)
        self._seconds.append(process_time() - start)
        self._keyframes.append(self._frames)
        self._frames += 1
        return T_map_base

    def corrected(self, online: NDArray[np.float64]) -> NDArray[np.float64]:
        """Each pose beside its last keyframe, where that is now believed to have been."""
        keyframes = np.array(self._keyframes)
        last = np.searchsorted(keyframes, np.arange(len(online)), side="right") - 1
        return (self._poses @ np.linalg.inv(online[keyframes]))[last] @ online

    def report(self, true: NDArray[np.float64], online: NDArray[np.float64]) -> dict[str, float]:
        """The time of a keyframe, and the errors on the way."""
        return {
            "keyframes": len(self._keyframes),
            "keyframe_ms": 1e3 * float(np.median(self._seconds)),
            "online_ate_m": trajectory_scores(true, online)["ate_m"],
        }


class Odometry(Method):
    """Wheels and gyro alone."""

    def __init__(self, T_map_start: NDArray[np.float64]):
        pass

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """As the frame says."""
        return frame.T_odom_base


class Kiss(Method):
    """KISS-ICP (Vizzo et al., RA-L 2023), whose guess is the odometry's motion instead of a constant velocity."""

    VOXEL = 0.05
    THRESHOLD, MIN_MOTION = 0.1, 0.01
    GUIDED = True

    def __init__(self, T_map_start: NDArray[np.float64]):
        near, far = PIONEER_3AT.camera_range
        config = KISSConfig(
            data=DataConfig(max_range=1.5 * far, min_range=near / 2, deskew=False),
            mapping=MappingConfig(voxel_size=self.VOXEL),
            registration=RegistrationConfig(max_num_threads=1),
            adaptive_threshold=AdaptiveThresholdConfig(
                initial_threshold=self.THRESHOLD, min_motion_th=self.MIN_MOTION
            ),
        )
        self._kiss = KissICP(config)
        self._kiss.last_pose = T_map_start
        self._last: NDArray[np.float64] | None = None

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """Register the frame's points with the local map."""
        if self._last is not None and self.GUIDED:
            self._kiss.last_delta = inverse(self._last) @ frame.T_odom_base
        self._last = frame.T_odom_base
        depth, rays = frame.depth[::STRIDE, ::STRIDE], frame.intrinsics.rays[::STRIDE, ::STRIDE]
        points = transform_points(frame.T_base_camera, rays[depth > 0] * depth[depth > 0, None])
        self._kiss.register_frame(points.astype(np.float64), np.zeros(0))
        return self._kiss.last_pose


class Open3d(Method):
    """Open3D's RGB-D odometry (Park, Zhou and Koltun, ICCV 2017), from frame to frame, guessed by the odometry."""

    METHOD = o3d.t.pipelines.odometry.Method.Hybrid
    GUIDED = True

    def __init__(self, T_map_start: NDArray[np.float64]):
        self._T_map_base = T_map_start
        self._last: tuple[Frame, o3d.t.geometry.RGBDImage] | None = None

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """Register the frame with the last one."""
        colour, depth = (o3d.t.geometry.Image(np.ascontiguousarray(image)) for image in (frame.rgb, frame.depth))
        image = o3d.t.geometry.RGBDImage(colour, depth)
        if self._last is not None:
            before, target = self._last
            moved = inverse(before.T_odom_base) @ frame.T_odom_base
            guess = inverse(before.T_base_camera) @ moved @ frame.T_base_camera
            T = self._register(image, target, frame.intrinsics, guess if self.GUIDED else np.eye(4))
            self._T_map_base = self._T_map_base @ before.T_base_camera @ T @ inverse(frame.T_base_camera)
        self._last = frame, image
        return self._T_map_base

    def _register(
        self, source: o3d.t.geometry.RGBDImage, target: o3d.t.geometry.RGBDImage, k: Intrinsics, guess: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """4×4 pose of the source's camera in the target's; the guess where Open3D finds none."""
        # Open3D has the centres of pixels at whole numbers.
        matrix = np.array([[k.fx, 0, k.cx - 0.5], [0, k.fy, k.cy - 0.5], [0, 0, 1]])
        try:
            result = o3d.t.pipelines.odometry.rgbd_odometry_multi_scale(
                source,
                target,
                o3d.core.Tensor.from_numpy(matrix),
                o3d.core.Tensor.from_numpy(guess),
                depth_scale=1.0,
                depth_max=PIONEER_3AT.camera_range[1],
                method=self.METHOD,
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
"""Each begins at a 4×4 ``T_map_base``."""
