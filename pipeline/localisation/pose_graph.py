"""The pose graph: keyframes, what odometry, gravity and registration say of them, and the poses that fit all best."""

import gtsam
import numpy as np
from numpy.typing import NDArray

from pipeline.localisation.registration import logarithm

GRAVITY = np.deg2rad(0.3)
"""rad, standard deviation of a keyframe's roll and pitch by the odometry: the accelerometer's, while it drives."""
FIXED = 1e-4
"""rad and m, standard deviation of what the first keyframe fixes: its place and its heading."""
LOOSE = 1e-3
"""Information that is added to edges, 1/rad² and 1/m²: of a plane alone a registration knows three directions."""
_UP = gtsam.Unit3(np.array([0.0, 0.0, 1.0]))


class PoseGraph:
    """Poses of keyframes and the constraints between them.

    Attributes:
        poses: 4×4 ``T_map_base`` of every keyframe, as it is now believed.
    """

    def __init__(self) -> None:
        self.poses: list[NDArray[np.float64]] = []
        self._factors = gtsam.NonlinearFactorGraph()
        self._ups: list[NDArray[np.float64]] = []

    def add(self, T_map_base: NDArray[np.float64], up: NDArray[np.float64]) -> int:
        """Add a keyframe and return its number.

        Args:
            T_map_base: 4×4 pose.
            up: (3,) the vertical in ``base_link``, by the odometry.
        """
        if not self.poses:
            sigmas = np.array([10.0, 10.0, FIXED, FIXED, FIXED, FIXED])
            model = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
            self._factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(T_map_base), model))
        self.poses.append(T_map_base)
        self._ups.append(up)
        return len(self.poses) - 1

    def connect(
        self, i: int, j: int, T_i_j: NDArray[np.float64], information: NDArray[np.float64], robust: bool = False
    ) -> None:
        """Constrain the pose of keyframe j in the frame of i, 4×4, with (6, 6) information in its tangent."""
        model = gtsam.noiseModel.Gaussian.Information(information + LOOSE * np.eye(6))
        if robust:
            model = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.GemanMcClure.Create(3.0), model)
        self._factors.add(gtsam.BetweenFactorPose3(i, j, gtsam.Pose3(T_i_j), model))

    def optimise(self) -> float:
        """Move the poses to where they fit all constraints best; the farthest that one moved, m."""
        graph = self._factors.clone()
        bias = self._tilt_bias()
        model = gtsam.noiseModel.Isotropic.Sigma(2, GRAVITY)
        for k, up in enumerate(self._ups):
            graph.add(gtsam.AttitudeFactorPose3(k, _UP, model, gtsam.Unit3(up - bias)))
        values = gtsam.Values()
        for k, T in enumerate(self.poses):
            values.insert(k, gtsam.Pose3(T))
        params = gtsam.LevenbergMarquardtParams()
        result = gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
        poses = [np.asarray(result.atPose3(k).matrix()) for k in range(len(self.poses))]
        moved = max(float(np.linalg.norm(a[:3, 3] - b[:3, 3])) for a, b in zip(poses, self.poses, strict=True))
        self.poses = poses
        return moved

    def _tilt_bias(self) -> NDArray[np.float64]:
        """(3,) what the odometry's vertical is off in ``base_link``: a level that is mounted askew."""
        off = np.array([up - T[2, :3] for up, T in zip(self._ups, self.poses, strict=True)])
        return off.mean(axis=0)
