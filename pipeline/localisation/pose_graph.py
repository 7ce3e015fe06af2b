"""The pose graph: poses of keyframes that fit the constraints by odometry, gravity and registration best."""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from pipeline.arrays import Covariance, Direction, Directions, Information, Pose, Poses, Values
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.drives import Drives
from pipeline.localisation.localisation import Loop, OdometryErrors
from pipeline.localisation.motion_model import MeasuredMotion
from pipeline.transforms import orthonormal

_ERRORS = 1 << 40  # key of the odometry's systematic errors, which all motions share


class PoseGraph:
    """Poses of keyframes and the constraints between them.

    Attributes:
        poses: ``T_map_base`` of every keyframe as now estimated.
        ups: the vertical in the ``base_link`` of each keyframe, by the odometry.
        odometry: systematic errors of the odometry as now estimated.
        drives: motions by odometry between keyframes.
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
        """Add a keyframe and return its number; ``up``: the vertical in ``base_link``, by the odometry."""
        if not len(self):
            sigmas = np.full(6, self._config.graph.fixed_sigma)
            sigmas[:2] = 1.0  # gravity levels it
            model = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
            self._factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(T_map_base), model))
        self.poses = np.concatenate([self.poses, T_map_base[None]])
        self.ups.append(up)
        return len(self) - 1

    def fix(self, poses: Poses, ups: Directions, odometry: OdometryErrors) -> None:
        """Begin with keyframes whose poses stay fixed, the vertical in each, and what was learnt of the odometry."""
        self.odometry = self._odometry_before = odometry
        fixed_sigma = self._config.graph.fixed_sigma
        model = gtsam.noiseModel.Isotropic.Sigma(6, fixed_sigma)
        for k, (T, up) in enumerate(zip(poses, ups, strict=True)):
            self.add(T, up)
            self._factors.add(gtsam.PriorFactorPose3(k, gtsam.Pose3(T), model))
        self._links |= {(k - 1, k): np.full(2, fixed_sigma**2) for k in range(1, len(poses))}

    def connect(self, i: int, j: int, T_map_base: Pose, information: Information, loop: Loop | None = None) -> None:
        """Add a constraint: the pose of keyframe j, given the present pose of keyframe i.

        Args:
            i, j: numbers of keyframes.
            T_map_base: of j.
            information: in the tangent at that pose.
            loop: that it belongs to; it may be an outlier, and :meth:`disconnect` takes it back.
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
        """Take back what was connected and linked by loops."""
        self._loops = [(loop, factor) for loop, factor in self._loops if loop not in loops]
        for loop in loops:
            self._links.pop((loop.first, loop.second), None)

    def drive(self, motion: MeasuredMotion) -> None:
        """Add the robot's motion by odometry from the previous keyframe to the newest one."""
        self.drives = self.drives.and_to(len(self) - 1, motion, self._config.odometry)

    def link(self, i: int, j: int, covariance: Covariance) -> None:
        """Remember the covariance of the pose of keyframe j relative to i; of several the smallest one counts."""
        lever = self._config.registration.lever
        variances = np.array([variance_of(covariance, lever), np.linalg.eigvalsh(covariance[:3, :3])[-1]])
        self._links[i, j] = np.minimum(variances, self._links.get((i, j), np.inf))

    def deviations(self, keyframe: int) -> Values:
        """(K,) m, standard deviation of each position relative to a keyframe, by the best chain of links."""
        return self._chained(keyframe, 0)

    def headings(self, keyframe: int) -> Values:
        """(K,) rad, standard deviation of each rotation relative to a keyframe, by the best chain of links.

        A gyro keeps it small where wheels alone measure the way, as along a corridor.
        """
        return self._chained(keyframe, 1)

    def _chained(self, keyframe: int, which: int) -> Values:
        """(K,) standard deviations relative to a keyframe by the best chain of one of the two variances of links."""
        ends = np.array(list(self._links), np.int64).reshape(-1, 2).T
        variances = np.array(list(self._links.values())).reshape(-1, 2)[:, which]
        links = coo_array((variances, tuple(ends)), shape=(len(self), len(self))).tocsr()
        return np.sqrt(dijkstra(links, directed=False, indices=keyframe))

    def covariance(self, keyframe: int) -> Covariance:
        """Of a keyframe's pose relative to the first one's, in its own tangent."""
        assert self._posterior is not None
        return np.asarray(self._posterior.marginalCovariance(keyframe))

    def optimise(self) -> None:
        """Move the poses so that they fit all constraints best."""
        problem, values = self._problem(), gtsam.Values()
        values.insert(_ERRORS, self.odometry.errors)
        for k, T in enumerate(self.poses):
            values.insert(k, gtsam.Pose3(T))
        values, self._posterior = minimise(problem, values, self._config.graph.tolerance)
        covariance = self._posterior.marginalCovariance(_ERRORS)
        self.odometry = OdometryErrors(values.atVector(_ERRORS), covariance)
        self.poses = orthonormal(poses_of(values))

    def _problem(self) -> "Problem":
        """All constraints: those of loops, and those by gravity and by what is known of the odometry, change."""
        graph = gtsam.NonlinearFactorGraph()
        graph.push_back(self._factors)
        for _, factor in self._loops:
            graph.add(factor)
        model = gtsam.noiseModel.Isotropic.Sigma(2, self._config.odometry.gravity_sigma)
        vertical = gtsam.Unit3(np.array([0.0, 0.0, 1.0]))
        bias = np.mean(np.array(self.ups) - self.poses[:, 2, :3], axis=0)  # of an accelerometer that is mounted askew
        for k, up in enumerate(self.ups):
            graph.add(gtsam.AttitudeFactorPose3(k, vertical, model, gtsam.Unit3(up - bias)))
        before = gtsam.noiseModel.Gaussian.Covariance(self._odometry_before.covariance)
        graph.add(gtsam.PriorFactorVector(_ERRORS, self._odometry_before.errors, before))
        return Problem(graph, self.drives)


@dataclass(frozen=True, eq=False)
class Problem:
    """Constraints of poses and of the odometry's systematic errors.

    GTSAM would call Python for each motion, so that they took most of the time: they are kept apart.
    """

    graph: gtsam.NonlinearFactorGraph
    drives: Drives

    def error(self, values: gtsam.Values) -> float:
        """Half the sum of the squared, whitened residuals."""
        residuals = self.drives.residuals(poses_of(values), values.atVector(_ERRORS))
        return float(self.graph.error(values) + np.sum(np.square(residuals)) / 2)

    def linearised(self, values: gtsam.Values) -> gtsam.GaussianFactorGraph:
        """The constraints about values."""
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
    """The values that fit best, by Gauss-Newton steps from others, and their distribution.

    A step that would make the error larger is halved. ``tolerance``: relative decrease of the error that ends it.
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
    """(6,) rad and m, standard deviations of a pose whose error moves what is ``lever`` m away by ``deviation`` m."""
    return np.repeat([deviation / lever, deviation], 3)


def variance_of(covariance: Covariance, lever: float) -> float:
    """m², variance of the position of a point ``lever`` m away from a pose with this covariance."""
    return float(np.trace(covariance[3:, 3:]) + lever**2 * np.linalg.eigvalsh(covariance[:3, :3])[-1])
