"""The pose graph: the keyframe poses that best fit the constraints from odometry, gravity and registration."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.transform import Rotation

from pipeline.arrays import Covariance, Direction, Directions, Indices, Information, Pose, Poses, Values
from pipeline.errors import required
from pipeline.localisation.config import LocalisationConfig, OdometryConfig
from pipeline.localisation.localisation import Loop, OdometryErrors
from pipeline.localisation.motion_model import MeasuredMotion
from pipeline.transforms import orthonormal

_ERRORS = 1 << 40  # key of the odometry's systematic errors, which all motions share


class Drives(NamedTuple):
    """Motions from odometry as constraints between keyframes, all evaluated at once.

    Attributes:
        end: (M,) index of the keyframe at the end of each motion, which starts at the keyframe before it.
        T: (M, 4, 4) the measured motions.
        turn, moves, turns, jacobian: see :class:`MeasuredMotion`; their first axis has length M.
        whitening: (M, 6, 6) square roots of the motions' information, which scale every residual's deviation to 1.
    """

    end: Indices
    T: Poses
    turn: NDArray[np.float64]
    moves: NDArray[np.float64]
    turns: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    whitening: NDArray[np.float64]

    @classmethod
    def none(cls) -> "Drives":
        """No motion yet."""
        shapes = (4, 4), (3,), (3, 5), (3, 5), (6, 5), (6, 6)
        return cls(np.zeros(0, np.int64), *(np.zeros((0, *shape)) for shape in shapes))

    def appended(self, keyframe: int, motion: MeasuredMotion, config: OdometryConfig) -> "Drives":
        """These motions, followed by the motion to a keyframe from the one before it."""
        whitening = np.linalg.inv(np.linalg.cholesky(motion.noise(config)))
        last = keyframe, motion.T, motion.turn, motion.moves, motion.turns, motion.jacobian, whitening
        return Drives(*(np.concatenate([those, np.array([this])]) for those, this in zip(self, last, strict=True)))

    def residuals(self, poses: Poses, errors: Values) -> NDArray[np.float64]:
        """(M, 6) deviations of the keyframes' poses from the motions, corrected for systematic errors (5,).

        In rad and m in the tangent space after each motion, multiplied by its ``whitening``.
        """
        R = Rotation.from_rotvec(self.turn + self.turns @ errors).as_matrix().swapaxes(1, 2)
        between = self._between(poses)
        turned = Rotation.from_matrix(R @ between[:, :3, :3]).as_rotvec()
        moved = R @ (between[:, :3, 3] - self.T[:, :3, 3] - self.moves @ errors)[..., None]
        return np.asarray(np.squeeze(self.whitening @ np.concatenate([turned[..., None], moved], axis=1), -1))

    def jacobians(self, poses: Poses) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Jacobians (M, 6, 6 or 5) of the residuals: with respect to the poses before and after, and to the errors.

        Those with respect to a pose are per rad and m in its tangent space.
        """
        before = adjoints(np.asarray(np.linalg.inv(self._between(poses)), np.float64))
        return -self.whitening @ before, self.whitening, -self.whitening @ self.jacobian

    def _between(self, poses: Poses) -> Poses:
        return np.asarray(np.linalg.inv(poses[self.end - 1]) @ poses[self.end])


def adjoints(T: Poses) -> NDArray[np.float64]:
    """(N, 6, 6) adjoint matrices, which map tangent vectors (rad, m) at the transforms to ones at the identity."""
    result = np.zeros((len(T), 6, 6))
    result[:, :3, :3] = result[:, 3:, 3:] = R = T[:, :3, :3]
    result[:, 3:, :3] = np.cross(T[:, :3, 3:], R, axis=1)
    return result


class PoseGraph:
    """Poses of keyframes and the constraints between them.

    Attributes:
        poses: current estimate of every keyframe's ``T_map_base``.
        ups: the vertical in each keyframe's ``base_link``, from the odometry.
        odometry: current estimate of the odometry's systematic errors.
        drives: motions between keyframes, from the odometry.
    """

    def __init__(self, config: LocalisationConfig) -> None:
        self._config, self.poses = config, np.zeros((0, 4, 4))
        self.odometry = self._odometry_before = OdometryErrors.expected(config.odometry)
        self._loops: list[tuple[Loop, gtsam.BetweenFactorPose3]] = []
        self._factors = gtsam.NonlinearFactorGraph()
        self.ups: list[Direction] = []
        self._links: dict[tuple[int, int], NDArray[np.float64]] = {}  # variances of position, m², and rotation, rad²
        self._posterior: gtsam.GaussianBayesTree | None = None
        self.drives = Drives.none()

    def __len__(self) -> int:
        """Number of keyframes."""
        return len(self.poses)

    def add(self, T_map_base: Pose, up: Direction) -> int:
        """Add a keyframe and return its index; ``up``: the vertical in ``base_link``, from the odometry."""
        if not len(self):
            sigmas = np.full(6, self._config.graph.fixed_sigma)
            sigmas[:2] = 1.0  # gravity determines roll and pitch
            model = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
            self._factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(T_map_base), model))
        self.poses = np.concatenate([self.poses, T_map_base[None]])
        self.ups.append(up)
        return len(self) - 1

    def fix(self, poses: Poses, ups: Directions, odometry: OdometryErrors) -> None:
        """Start with keyframes at fixed poses, the vertical in each, and known systematic errors of the odometry."""
        self.odometry = self._odometry_before = odometry
        fixed_sigma = self._config.graph.fixed_sigma
        model = gtsam.noiseModel.Isotropic.Sigma(6, fixed_sigma)
        for k, (T, up) in enumerate(zip(poses, ups, strict=True)):
            self.add(T, up)
            self._factors.add(gtsam.PriorFactorPose3(k, gtsam.Pose3(T), model))
        self._links |= {(k - 1, k): np.full(2, fixed_sigma**2) for k in range(1, len(poses))}

    def connect(self, i: int, j: int, T_map_base: Pose, information: Information, loop: Loop | None = None) -> None:
        """Add a constraint: the pose of keyframe j, given the current pose of keyframe i.

        Args:
            i, j: indices of the keyframes.
            T_map_base: pose of keyframe j.
            information: information of that pose, in its tangent space.
            loop: the loop that the constraint belongs to, which may be an outlier; :meth:`disconnect` removes it.
        """
        config = self._config.graph
        whole = information + config.least_information * np.eye(len(information))
        model = gtsam.noiseModel.Gaussian.Information(whole)
        T_i_j = gtsam.Pose3(np.linalg.solve(self.poses[i], T_map_base))
        if loop is None:
            self._factors.add(gtsam.BetweenFactorPose3(i, j, T_i_j, model))
        else:
            loss = gtsam.noiseModel.mEstimator.GemanMcClure.Create(config.outlier)
            robust = gtsam.noiseModel.Robust.Create(loss, model)
            self._loops.append((loop, gtsam.BetweenFactorPose3(i, j, T_i_j, robust)))

    def disconnect(self, loops: Sequence[Loop]) -> None:
        """Remove the constraints and links of loops."""
        self._loops = [(loop, factor) for loop, factor in self._loops if loop not in loops]
        for loop in loops:
            self._links.pop((loop.first, loop.second), None)

    def drive(self, motion: MeasuredMotion) -> None:
        """Add the odometry's motion from the previous keyframe to the newest one."""
        self.drives = self.drives.appended(len(self) - 1, motion, self._config.odometry)

    def link(self, i: int, j: int, covariance: Covariance) -> None:
        """Store the variances of keyframe j's pose relative to keyframe i; of several, the smallest count."""
        lever = self._config.registration.lever
        variances = np.array([variance_of(covariance, lever), np.linalg.eigvalsh(covariance[:3, :3])[-1]])
        self._links[i, j] = np.minimum(variances, self._links.get((i, j), np.inf))

    def deviations(self, keyframe: int) -> Values:
        """(K,) standard deviation of each position relative to a keyframe, m, along the best chain of links."""
        return self._chained(keyframe, 0)

    def headings(self, keyframe: int) -> Values:
        """(K,) standard deviation of each rotation relative to a keyframe, rad, along the best chain of links.

        The gyro keeps it small where only the wheels measure the distance, as along a corridor.
        """
        return self._chained(keyframe, 1)

    def _chained(self, keyframe: int, which: int) -> Values:
        """(K,) deviations relative to a keyframe along the best chain of links; ``which``: 0 position, 1 rotation."""
        ends = np.array(list(self._links), np.int64).reshape(-1, 2).T
        variances = np.array(list(self._links.values())).reshape(-1, 2)[:, which]
        links = coo_array((variances, tuple(ends)), shape=(len(self), len(self))).tocsr()
        return np.sqrt(dijkstra(links, directed=False, indices=keyframe))

    def covariance(self, keyframe: int) -> Covariance:
        """Covariance of a keyframe's pose relative to the first one's, in its own tangent space, once optimised."""
        return np.asarray(required(self._posterior).marginalCovariance(keyframe))

    def optimise(self) -> None:
        """Move the poses to where they best fit all constraints."""
        problem, values = self._problem(), gtsam.Values()
        values.insert(_ERRORS, self.odometry.errors)
        for k, T in enumerate(self.poses):
            values.insert(k, gtsam.Pose3(T))
        values, self._posterior = minimise(problem, values, self._config.graph.tolerance)
        covariance = self._posterior.marginalCovariance(_ERRORS)
        self.odometry = OdometryErrors(values.atVector(_ERRORS), covariance)
        self.poses = orthonormal(poses_of(values))

    def _problem(self) -> "Problem":
        """All constraints; those from loops, gravity and prior knowledge of the odometry change between calls."""
        graph = gtsam.NonlinearFactorGraph()
        graph.push_back(self._factors)
        for _, factor in self._loops:
            graph.add(factor)
        model = gtsam.noiseModel.Isotropic.Sigma(2, self._config.odometry.gravity_sigma)
        vertical = gtsam.Unit3(np.array([0.0, 0.0, 1.0]))
        bias = np.mean(np.array(self.ups) - self.poses[:, 2, :3], axis=0)  # the accelerometer may be mounted askew
        for k, up in enumerate(self.ups):
            graph.add(gtsam.AttitudeFactorPose3(k, vertical, model, gtsam.Unit3(up - bias)))
        before = gtsam.noiseModel.Gaussian.Covariance(self._odometry_before.covariance)
        graph.add(gtsam.PriorFactorVector(_ERRORS, self._odometry_before.errors, before))
        return Problem(graph, self.drives)


@dataclass(frozen=True, eq=False)
class Problem:
    """Constraints on the poses and on the odometry's systematic errors.

    The motions are kept out of the GTSAM graph, which would spend most of its time calling Python for each of them.
    """

    graph: gtsam.NonlinearFactorGraph
    drives: Drives

    def error(self, values: gtsam.Values) -> float:
        """Half the sum of the squared, whitened residuals."""
        residuals = self.drives.residuals(poses_of(values), values.atVector(_ERRORS))
        return float(self.graph.error(values) + np.sum(np.square(residuals)) / 2)

    def linearised(self, values: gtsam.Values) -> gtsam.GaussianFactorGraph:
        """The constraints, linearised at ``values``."""
        linear, poses, unit = self.graph.linearize(values), poses_of(values), gtsam.noiseModel.Unit.Create(6)
        residuals = self.drives.residuals(poses, values.atVector(_ERRORS))
        for j, before, after, errors, off in zip(
            self.drives.end, *self.drives.jacobians(poses), residuals, strict=True
        ):
            linear.add(gtsam.JacobianFactor(j - 1, before, j, after, _ERRORS, errors, -off, unit))
        return linear


def minimise(
    problem: Problem, values: gtsam.Values, tolerance: float
) -> tuple[gtsam.Values, gtsam.GaussianBayesTree]:
    """The best-fitting values, found by Gauss-Newton steps from initial ``values``, and their posterior distribution.

    A step that would increase the error is halved. ``tolerance``: relative decrease of the error at which to stop.
    """
    error = problem.error(values)
    while True:
        posterior, unchanged = problem.linearised(values).eliminateMultifrontal(), tolerance * max(1.0, error)
        step = posterior.optimize()
        while (after := problem.error(values.retract(step))) > error + unchanged:
            step = step.scale(0.5)
        values, decrease, error = values.retract(step), error - after, after
        if not decrease > unchanged:
            return values, posterior


def poses_of(values: gtsam.Values) -> Poses:
    """Poses of all keyframes."""
    rows = gtsam.utilities.extractPose3(values)
    result = np.tile(np.eye(4), (len(rows), 1, 1))
    result[:, :3, :3], result[:, :3, 3] = rows[:, :9].reshape(-1, 3, 3), rows[:, 9:]
    return result


def spread(deviation: float, lever: float) -> Values:
    """(6,) standard deviations of a pose, rad and m, each moving a point ``lever`` m away by ``deviation`` m."""
    return np.repeat([deviation / lever, deviation], 3)


def variance_of(covariance: Covariance, lever: float) -> float:
    """Variance of the position of a point ``lever`` m away from a pose with this covariance, m²."""
    return float(np.trace(covariance[3:, 3:]) + lever**2 * np.linalg.eigvalsh(covariance[:3, :3])[-1])
