"""The pose graph: poses of keyframes that fit the constraints by odometry, gravity and registration best."""

from typing import NamedTuple

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from pipeline.transforms import orthonormal

GRAVITY_SIGMA = np.deg2rad(0.3)
"""rad, standard deviation of a keyframe's roll and pitch by the odometry: the accelerometer's during a drive."""
FIXED = 1e-4
"""rad and m, standard deviation of a fixed pose: the first keyframe's position and heading, and restored poses."""
LOOSE = 1e-3
"""1/rad² and 1/m², information added to each constraint: a plane alone determines only three directions."""
LEVER = 2.0
"""m, typical distance of what the robot sees, which converts an error of heading into one of position."""
OUTLIER = 3.0
"""Standard deviations from which on a loop counts for less (Geman and McClure)."""
GYRO_SIGMA = 0.005, 5e-5
"""Initial standard deviations of the gyro's scale and of its bias in rad/s."""
_GYRO = 1 << 40  # key of the gyro's scale and bias, which all motions by odometry share


class OdometryMotion(NamedTuple):
    """A motion by odometry.

    Attributes:
        T: 4×4 motion if the odometry had no errors.
        moves: (3, 5) derivative of the translation, m, by the odometry's errors, see :class:`PoseGraph`.
        J: (6, 2) derivative, in the tangent after the motion, by the gyro's errors.
        covariance: (6, 6) apart from these errors, rad² and m².
    """

    T: NDArray[np.float64]
    moves: NDArray[np.float64]
    J: NDArray[np.float64]
    covariance: NDArray[np.float64]


class PoseGraph:
    """Poses of keyframes and the constraints between them.

    Attributes:
        poses: (K, 4, 4) ``T_map_base`` of every keyframe as now estimated.
        ups: (3,) each, the vertical in the ``base_link`` of each keyframe, by the odometry.
        gyro: (2,) relative error of the gyro's scale, and its bias in rad/s.
        odometry: (5,) errors of the odometry as now known, parameters of the motion model. All motions follow them,
            the first ones too; only those of the gyro are estimated by the graph itself.
    """

    def __init__(self) -> None:
        self.poses = np.zeros((0, 4, 4))
        self.gyro, self.odometry = np.zeros(2), np.zeros(5)
        self._factors = gtsam.NonlinearFactorGraph()
        self.ups: list[NDArray[np.float64]] = []
        self._links: dict[tuple[int, int], float] = {}

    def __len__(self) -> int:
        """Number of keyframes."""
        return len(self.poses)

    def add(self, T_map_base: NDArray[np.float64], up: NDArray[np.float64]) -> int:
        """Add a keyframe and return its number.

        Args:
            T_map_base: 4×4 pose.
            up: (3,) the vertical in ``base_link``, by the odometry.
        """
        if not len(self):
            model = gtsam.noiseModel.Diagonal.Sigmas(np.array([1.0, 1.0, FIXED, FIXED, FIXED, FIXED]))
            self._factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(T_map_base), model))
        self.poses = np.concatenate([self.poses, T_map_base[None]])
        self.ups.append(up)
        return len(self) - 1

    def fix(self, poses: NDArray[np.float64], ups: NDArray[np.float64]) -> None:
        """Begin with keyframes whose poses stay fixed: (K, 4, 4) poses, and the vertical in each (K, 3)."""
        model = gtsam.noiseModel.Isotropic.Sigma(6, FIXED)
        for k, (T, up) in enumerate(zip(poses, ups, strict=True)):
            self.add(T, up)
            self._factors.add(gtsam.PriorFactorPose3(k, gtsam.Pose3(T), model))
        self._links |= {(k - 1, k): FIXED**2 for k in range(1, len(poses))}

    def connect(
        self, i: int, j: int, T_map_base: NDArray[np.float64], information: NDArray[np.float64], is_loop: bool = False
    ) -> None:
        """Add a constraint: the pose of keyframe j, given the present pose of keyframe i.

        Args:
            i, j: numbers of keyframes.
            T_map_base: 4×4 pose of j.
            information: (6, 6) in the tangent at that pose, 1/rad² and 1/m².
            is_loop: whether it may be an outlier.
        """
        gaussian = gtsam.noiseModel.Gaussian.Information(information + LOOSE * np.eye(len(information)))
        robust = gtsam.noiseModel.mEstimator.GemanMcClure.Create(OUTLIER)
        model = gtsam.noiseModel.Robust.Create(robust, gaussian) if is_loop else gaussian
        T_i_j = gtsam.Pose3(np.linalg.solve(self.poses[i], T_map_base))
        self._factors.add(gtsam.BetweenFactorPose3(i, j, T_i_j, model))

    def drive(self, drive: OdometryMotion) -> None:
        """Add the robot's motion by odometry from the previous keyframe to the newest one."""
        model, j = gtsam.noiseModel.Gaussian.Covariance(drive.covariance), len(self) - 1
        R = gtsam.Rot3(drive.T[:3, :3])

        def error(_: object, values: gtsam.Values, H: list[NDArray[np.float64]] | None) -> NDArray[np.float64]:
            between = values.atPose3(j - 1).between(values.atPose3(j))
            delta = gtsam.Pose3(R, drive.T[:3, 3] + drive.moves @ self.odometry)
            expected = delta.compose(gtsam.Pose3.Expmap(drive.J @ values.atVector(_GYRO)))
            if H is not None:
                H[0], H[1], H[2] = -between.inverse().AdjointMap(), np.eye(6), -drive.J
            return np.asarray(gtsam.Pose3.Logmap(expected.between(between)))

        self._factors.add(gtsam.CustomFactor(model, [j - 1, j, _GYRO], error))

    def link(self, i: int, j: int, covariance: NDArray[np.float64]) -> None:
        """Remember the (6, 6) covariance of keyframe j relative to i; of several the smallest one counts."""
        self._links[i, j] = min(variance_of(covariance), self._links.get((i, j), np.inf))

    def deviations(self) -> NDArray[np.float64]:
        """(K,) m, standard deviation of each position relative to the newest keyframe, by the best chain of links."""
        ends = np.array(list(self._links), np.int64).reshape(-1, 2).T
        links = coo_array((list(self._links.values()), tuple(ends)), shape=(len(self), len(self))).tocsr()
        return np.sqrt(dijkstra(links, directed=False, indices=len(self) - 1))

    def optimise(self) -> None:
        """Move the poses so that they fit all constraints best."""
        graph = gtsam.NonlinearFactorGraph()
        graph.push_back(self._factors)
        model = gtsam.noiseModel.Isotropic.Sigma(2, GRAVITY_SIGMA)
        vertical = gtsam.Unit3(np.array([0.0, 0.0, 1.0]))
        bias = np.mean(np.array(self.ups) - self.poses[:, 2, :3], axis=0)  # of an accelerometer that is mounted askew
        for k, up in enumerate(self.ups):
            graph.add(gtsam.AttitudeFactorPose3(k, vertical, model, gtsam.Unit3(up - bias)))
        graph.add(gtsam.PriorFactorVector(_GYRO, np.zeros(2), gtsam.noiseModel.Diagonal.Sigmas(np.array(GYRO_SIGMA))))
        values = gtsam.Values()
        values.insert(_GYRO, self.gyro)
        for k, T in enumerate(self.poses):
            values.insert(k, gtsam.Pose3(T))
        params = gtsam.LevenbergMarquardtParams()
        params.setRelativeErrorTol(1e-3)
        result = gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
        self.gyro = result.atVector(_GYRO)
        self.poses = orthonormal(np.array([result.atPose3(k).matrix() for k in range(len(self))]))


def spread(deviation: float) -> NDArray[np.float64]:
    """(6,) rad and m, standard deviations of a pose whose error moves what the robot sees by ``deviation`` m."""
    return np.repeat([deviation / LEVER, deviation], 3)


def variance_of(covariance: NDArray[np.float64]) -> float:
    """m², variance of the position of a point ``LEVER`` m away from a pose with this covariance (6, 6)."""
    return float(np.trace(covariance[3:, 3:]) + LEVER**2 * np.linalg.eigvalsh(covariance[:3, :3])[-1])
