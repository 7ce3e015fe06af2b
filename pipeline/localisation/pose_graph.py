"""The pose graph: the keyframe poses that best fit the constraints from odometry, gravity and registration.

The poses minimise the whitened residuals of all constraints (Grisetti et al., "A tutorial on graph-based SLAM", 2010)
by Gauss-Newton steps. Any constraint may be wrong, because wheels slip and registration errs. The loss is therefore
Geman and McClure's, and each step weights a constraint by how well it fits. The uncertainty of the poses relative to
each other follows from samples of their distribution (Papandreou and Yuille, "Gaussian sampling by local
perturbations", 2010).

Tangent vectors hold rotation before translation and act on the right: T · (Exp(δ_r), δ_t).
"""

from dataclasses import dataclass
from enum import IntEnum, auto
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import SuperLU, splu
from scipy.spatial.transform import Rotation

from pipeline.arrays import Covariance, Direction, Directions, Indices, Information, Mask, Pose, Poses, Values
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.gates import chi2_gate
from pipeline.localisation.growing import GrowingArray
from pipeline.localisation.localisation import OdometryErrors
from pipeline.localisation.motion_model import MeasuredMotion
from pipeline.transforms import orthonormal

ERROR_COUNT = 7
"""Number of systematic errors of the odometry."""
SAMPLES = 64
"""Number of samples of the poses' distribution; they determine a standard deviation to within 9%."""
MAX_STEPS = 30
"""Maximum number of Gauss-Newton steps; a few are enough unless a loop closure moves the poses far."""
MIN_STEP_FRACTION = 2.0**-10
"""Minimum fraction to which a step is shortened; if the error still increases, the step is not taken."""
REFACTORISE_RATIO = 0.25
"""Maximum decrease of the error by a step, as a fraction of the previous step's decrease; above it, convergence is
slow, and the information is factorised again."""
CONVEXITY_FACTORS = 1e6, 1e3, 1e2, 1e1, 1.0
"""Multipliers, applied in turn where poses may move far, of the squared residual at which a constraint loses its
weight (graduated non-convexity; Yang et al., "Graduated non-convexity for robust spatial perception", 2020)."""

COARSE_TOLERANCE = 1e-3
"""Tolerance of the solutions with all ``CONVEXITY_FACTORS`` but the last; it is coarse because these solutions are
only starting points."""


class ConstraintKind(IntEnum):
    """The source of a constraint."""

    MOTION = 0
    """The robot's motion from one keyframe to the other, from odometry if it can be trusted."""
    SURFACE = auto()
    """Registration with surfaces that another keyframe saw first."""
    GROUND = auto()
    """The height of the ground under the robot."""
    LOOP = auto()
    """Registration with surfaces of keyframes whose relative position was uncertain."""


class Constraints(NamedTuple):
    """N relative poses of keyframes, as (N, …) arrays that are evaluated together.

    Attributes:
        first, second: indices of the keyframes.
        T: measured pose of the second in the frame of the first.
        whitening: (N, 6, 6) square root of the information, which scales every residual's standard deviation to 1.
        turn: (N, 3) rotation vector of ``T``, rad.
        translation_jacobian, rotation_jacobian, jacobian: Jacobians of the :class:`MeasuredMotion` from odometry; 0
            for other constraints.
    """

    first: Indices
    second: Indices
    T: Poses
    whitening: NDArray[np.float64]
    turn: NDArray[np.float64]
    translation_jacobian: NDArray[np.float64]
    rotation_jacobian: NDArray[np.float64]
    jacobian: NDArray[np.float64]

    def select(self, chosen: Mask | Indices) -> "Constraints":
        """The constraints that a mask or indices select."""
        values: list[NDArray[Any]] = [of_all[chosen] for of_all in self]
        return Constraints(*values)

    def residuals(self, poses: Poses, errors: Values) -> NDArray[np.float64]:
        """(N, 6) whitened deviations of the poses from the constraints, corrected for systematic errors (7,)."""
        turned = Rotation.from_rotvec(self.turn + self.rotation_jacobian @ errors).as_matrix().swapaxes(1, 2)
        between = relative_poses(poses, self.first, self.second)
        rotation = Rotation.from_matrix(turned @ between[:, :3, :3]).as_rotvec()
        moved = turned @ (between[:, :3, 3] - self.T[:, :3, 3] - self.translation_jacobian @ errors)[..., None]
        return np.asarray((self.whitening @ np.concatenate([rotation[..., None], moved], axis=1))[..., 0])

    def chi2(self, poses: Poses, errors: Values) -> Values:
        """(N,) squared whitened deviation of the poses from each constraint."""
        return np.asarray(np.square(self.residuals(poses, errors)).sum(axis=1))

    def jacobians(self, poses: Poses) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Jacobians (N, 6, 6 or 7) of residuals near 0, w.r.t. the first pose, the second pose and the errors."""
        before = adjoints(inverses(relative_poses(poses, self.first, self.second)))
        return -self.whitening @ before, self.whitening, -self.whitening @ self.jacobian


def relative_poses(poses: Poses, first: Indices, second: Indices) -> Poses:
    """(N, 4, 4) poses of keyframes ``second`` in the frames of keyframes ``first``."""
    return np.asarray(inverses(poses[first]) @ poses[second])


def weights_of(chi2: Values, scale: float) -> Values:
    """Weights of constraints with squared whitened residuals ``chi2`` (loss function of Geman and McClure)."""
    return np.asarray(np.square(scale / (scale + chi2)))


def inverses(T: Poses) -> Poses:
    """(N, 4, 4) inverses of rigid transforms."""
    result = np.zeros_like(T)
    R = T[:, :3, :3].swapaxes(1, 2)
    result[:, :3, :3] = R
    result[:, :3, 3] = -np.einsum("nij,nj->ni", R, T[:, :3, 3])
    result[:, 3, 3] = 1.0
    return result


def adjoints(T: Poses) -> NDArray[np.float64]:
    """(N, 6, 6) adjoint matrices of transforms.

    They map tangent vectors at the transforms, rad and m, to tangent vectors at the identity.
    """
    result = np.zeros((len(T), 6, 6))
    result[:, :3, :3] = result[:, 3:, 3:] = R = T[:, :3, :3]
    result[:, 3:, :3] = np.cross(T[:, :3, 3:], R, axis=1)
    return result


class PoseGraph:
    """Poses of keyframes and the constraints between them.

    Attributes:
        poses: current estimate of every keyframe's ``T_map_base``.
        odometry: current estimate of the odometry's systematic errors.
        dropped: number of constraints that were left out because they were not finite.
        is_unsettled: whether the poses may be far from the optimum, for example after a loop was closed or removed.
    """

    def __init__(self, config: LocalisationConfig) -> None:
        self._config = config
        self.odometry = self._odometry_prior = OdometryErrors.expected(config.odometry)
        self.dropped = 0
        self._poses = GrowingArray(4, 4)
        self._ups = GrowingArray(3)
        self._samples = GrowingArray(6, SAMPLES)
        shapes = (4, 4), (6, 6), (3,), (3, ERROR_COUNT), (3, ERROR_COUNT), (6, ERROR_COUNT)
        ends = GrowingArray(dtype=np.int64), GrowingArray(dtype=np.int64)
        self._rows = [*ends, *(GrowingArray(*shape) for shape in shapes)]
        self._kinds = GrowingArray(dtype=np.int64)
        self._fixed_count = 0
        self._rng = np.random.default_rng(0)
        self._solved_count = 0
        self.is_unsettled = False
        self._settled_count = 0

    def __len__(self) -> int:
        """Number of keyframes."""
        return len(self._poses)

    @property
    def poses(self) -> Poses:
        """Current estimate of every keyframe's ``T_map_base``."""
        return self._poses.values

    @poses.setter
    def poses(self, poses: Poses) -> None:
        self._poses.values = poses

    @property
    def ups(self) -> Directions:
        """(K, 3) unit vectors of the vertical in each keyframe's ``base_link``, from the odometry."""
        return self._ups.values

    @property
    def constraints(self) -> Constraints:
        """All constraints between keyframes."""
        return Constraints(*(row.values for row in self._rows))

    @property
    def kinds(self) -> Indices:
        """(N,) the :class:`ConstraintKind` of each constraint."""
        return self._kinds.values

    def add(self, T_map_base: Pose, up: Direction) -> int:
        """Add a keyframe and return its index; ``up``: the vertical in ``base_link``, from the odometry."""
        self._poses.append(T_map_base)
        self._ups.append(up)
        self._samples.append(np.zeros((6, SAMPLES)))
        return len(self) - 1

    def fix(self, poses: Poses, ups: Directions, odometry: OdometryErrors) -> None:
        """Start with keyframes at fixed poses, the vertical in each, and known systematic errors of the odometry."""
        self.odometry = self._odometry_prior = odometry
        for T, up in zip(poses, ups, strict=True):
            self.add(T, up)
        self._fixed_count = self._solved_count = len(self)

    def connect(self, i: int, j: int, T_map_base: Pose, information: Information, kind: ConstraintKind) -> None:
        """Add a constraint on the pose of keyframe j relative to the current pose of keyframe i.

        A constraint that is not finite is left out and counted in ``dropped``. A constraint without information is
        left out, too.

        Args:
            i, j: indices of the keyframes.
            T_map_base: pose of keyframe j.
            information: information of this pose, in its tangent space.
            kind: source of the constraint.
        """
        if not (np.isfinite(T_map_base).all() and np.isfinite(information).all()):
            self.dropped += 1
            return
        if not information.any():
            return
        strength, directions = np.linalg.eigh(information)
        whitening = np.sqrt(np.maximum(strength, 0.0))[:, None] * directions.T
        T = np.linalg.solve(self.poses[i], T_map_base)
        nothing = (np.zeros((3, ERROR_COUNT)), np.zeros((3, ERROR_COUNT)), np.zeros((6, ERROR_COUNT)))
        turn = Rotation.from_matrix(T[:3, :3]).as_rotvec()
        self._append(i, j, T, whitening, turn, *nothing, kind=kind)

    def add_motion(self, motion: MeasuredMotion) -> None:
        """Add a constraint from the odometry's motion between the previous keyframe and the newest one."""
        k, whitening = len(self) - 1, np.linalg.inv(np.linalg.cholesky(motion.noise(self._config.odometry)))
        self._append(
            k - 1, k, motion.T, whitening, motion.shortest_turn,
            motion.translation_jacobian, motion.rotation_jacobian, motion.jacobian, kind=ConstraintKind.MOTION,
        )  # fmt: skip

    def _append(self, *values: object, kind: ConstraintKind) -> None:
        for row, value in zip(self._rows, values, strict=True):
            row.append(value)  # type: ignore[arg-type]
        self._kinds.append(kind)

    def remove(self, chosen: Mask) -> None:
        """Remove the constraints that a mask (N,) selects."""
        for row in (*self._rows, self._kinds):
            row.values = row.values[~chosen]
        self._settled_count, self.is_unsettled = len(self._kinds), True

    def extend_samples(self, reference: int, motion: Information) -> None:
        """Draw samples of the newest keyframe's pose from gravity, its motion and the surfaces registered with it.

        The samples of earlier keyframes stay as they are until :meth:`optimise` draws all samples anew. As in
        :meth:`optimise`, surfaces that contradict the pose have a lower weight.

        Args:
            reference: index of an earlier keyframe.
            motion: information of the newest keyframe's pose relative to the reference, in its tangent space.
        """
        k, samples = len(self) - 1, self._samples.values
        constraints = self.constraints
        surfaces = constraints.select((constraints.second == k) & (self.kinds != ConstraintKind.MOTION))
        chi2 = surfaces.chi2(self.poses, self.odometry.errors)
        roots = np.sqrt(weights_of(chi2, chi2_gate(6, self._config.registration.confidence)))
        level, up = np.zeros((6, 6)), self.ups[k]
        level[:3, :3] = (np.eye(3) - np.outer(up, up)) / self._config.odometry.gravity_sigma
        total, pull = level @ level, level @ self._rng.normal(size=(6, SAMPLES))
        for keyframe, whitening in (
            (reference, np.linalg.cholesky(motion).T),
            *zip(surfaces.first, roots[:, None, None] * surfaces.whitening, strict=True),
        ):
            (T,) = adjoints(relative_poses(self.poses, np.array([k]), np.array([keyframe])))
            total += whitening.T @ whitening
            pull += whitening.T @ (whitening @ T @ samples[keyframe] + self._rng.normal(size=(6, SAMPLES)))
        samples[k] = np.linalg.solve(total, pull)

    def relative_samples(self, keyframe: int, others: Indices | slice = slice(None)) -> NDArray[np.float64]:
        """(K, 6, S) samples of the error of other keyframes relative to a keyframe, in its tangent space.

        The errors are evaluated at the given keyframe's position, so a rotation error of another keyframe adds a
        position error in proportion to the distance between the two.
        """
        poses, samples = self.poses[others], self._samples.values
        between = adjoints(np.asarray(inverses(self.poses[[keyframe]]) @ poses))
        return np.asarray(between @ samples[others] - samples[keyframe])

    def covariance(self, keyframe: int, reference: int = 0) -> Covariance:
        """Covariance of a keyframe's pose relative to a ``reference`` keyframe, in the tangent space of the former.

        The divisor corrects the bias of the inverse of a sample covariance, which would otherwise be too large
        (Hartlap, Simon and Schneider, "Why your model parameter confidences might be too optimistic", 2007).
        """
        errors = self.relative_samples(keyframe, np.array([reference]))[0]
        return np.asarray(errors @ errors.T) / (SAMPLES - 6 - 1)

    def deviations(self, keyframe: int) -> Values:
        """(K,) m, standard deviation of each keyframe's position relative to a given keyframe.

        This is the standard deviation of a point ``typical_range`` m away from the given keyframe. The point moves
        rigidly with the other keyframe.
        """
        errors, typical_range = self.relative_samples(keyframe), self._config.registration.typical_range
        rotation = np.square(errors[:, :3]).mean(axis=2).max(axis=1)
        position = np.square(errors[:, 3:]).mean(axis=2).sum(axis=1)
        return np.asarray(np.sqrt(position + typical_range**2 * rotation))

    def optimise(self) -> None:
        """Find the poses that best fit all constraints, and sample their distribution again.

        The older poses stay fixed while the graph has grown little since it was last solved as a whole. They are
        freed if a loop was closed, if a constraint was removed, or if a new motion from an older keyframe contradicts
        them.
        """
        new = self.constraints.select(np.arange(self._settled_count, len(self._kinds)))
        off = new.chi2(self.poses, self.odometry.errors)
        contradicted = off > chi2_gate(6, self._config.registration.confidence)
        grown, window = len(self) - self._solved_count, self._config.graph.window
        # A registration with surfaces of an older keyframe moves the newest poses at once, and the others gradually.
        tells = np.isin(self.kinds[self._settled_count :], (ConstraintKind.MOTION, ConstraintKind.LOOP))
        self.is_unsettled |= bool((contradicted & tells & (new.first < len(self) - 2 * window)).any())
        self._settled_count = len(self._kinds)
        is_whole = len(self) <= 2 * window or grown > window or self.is_unsettled
        free = np.arange(len(self)) >= (
            self._fixed_count if is_whole else max(self._fixed_count, len(self) - 2 * window)
        )
        problem = Problem.of(self, free, is_whole)
        # If poses may move far, first weight all constraints alike, then trust ever fewer of them.
        *loosened, last = CONVEXITY_FACTORS
        for loosening in loosened if self.is_unsettled or contradicted.any() else ():
            problem.solve(COARSE_TOLERANCE, loosening)
        problem.solve(self._config.graph.tolerance, last)
        poses = self.poses.copy()  # Callers may still hold the old poses
        poses[free] = orthonormal(problem.poses[free])
        self.poses = poses
        self._samples.values[free] = problem.sample(self._rng, self._samples.values)[free]
        if is_whole:
            self.odometry = OdometryErrors(problem.errors, problem.error_covariance())
            self._solved_count = len(self)
            self.is_unsettled = False

    def chi2(self) -> Values:
        """(N,) squared whitened residual of each constraint at the current poses."""
        return self.constraints.chi2(self.poses, self.odometry.errors)


@dataclass(eq=False)
class Problem:
    """The least-squares problem for the poses of the free keyframes and, optionally, the systematic errors.

    Attributes:
        poses: poses of all keyframes.
        errors: (7,) systematic errors.
        constraints: the constraints that involve a free keyframe.
        free: (K,) whether each pose may move.
        frees_errors: whether the systematic errors are variables.
        ups: (K, 3) vertical in each keyframe's ``base_link``, without the accelerometer's mean error.
        prior_errors: prior knowledge of the systematic errors.
        start: pose at which the first keyframe is held, if it is free.
        config: settings, including the weights of the constraints.
    """

    poses: Poses
    errors: Values
    constraints: Constraints
    free: Mask
    frees_errors: bool
    ups: Directions
    prior_errors: OdometryErrors
    start: Pose
    config: LocalisationConfig

    @classmethod
    def of(cls, graph: PoseGraph, free: Mask, frees_errors: bool) -> "Problem":
        """The problem for the ``free`` keyframes of a graph; ``frees_errors``: whether the errors are variables."""
        constraints = graph.constraints
        involved = free[constraints.first] | free[constraints.second]
        bias = np.mean(graph.ups - graph.poses[:, 2, :3], axis=0)  # the accelerometer may be mounted askew
        return cls(
            graph.poses.copy(), graph.odometry.errors.copy(), constraints.select(involved), free, frees_errors,
            graph.ups - bias, graph._odometry_prior, graph.poses[0].copy(), graph._config,
        )  # fmt: skip

    def __post_init__(self) -> None:
        self._at = np.cumsum(self.free) - 1
        self._variables = 6 * int(self.free.sum())
        self._size = self._variables + (ERROR_COUNT if self.frees_errors else 0)
        self._gravity_weight = 1 / self.config.odometry.gravity_sigma
        sigmas = np.full(6, self.config.graph.fixed_sigma)
        sigmas[:2] = 1.0  # gravity determines roll and pitch
        self._start_whitening = 1 / sigmas
        self._prior_whitening = np.linalg.inv(np.linalg.cholesky(self.prior_errors.covariance))

    def solve(self, tolerance: float, loosening: float = 1.0) -> None:
        """Move the poses by Gauss-Newton steps, until the error decreases by less than the fraction ``tolerance``.

        ``loosening``: multiplier of the squared residual at which a constraint loses its weight.
        """
        self._scale = loosening * chi2_gate(6, self.config.registration.confidence)
        error, decrease, last, is_stale = self._error(self.poses, self.errors), np.inf, np.inf, True
        for _ in range(MAX_STEPS):
            # Linearise, and weight each constraint by how well it fits. Factorisation takes the most time, so it is
            # repeated only where steps with the last factors converge slowly.
            gradient = self._linearised(factorises=is_stale)
            step, length = self._factor.solve(gradient), 1.0
            # Take the step, halved for as long as it would increase the error.
            unchanged = tolerance * max(1.0, error)
            while not (after := self._error(*self._moved(length * step))) <= error + unchanged:
                length /= 2
                if length < MIN_STEP_FRACTION:
                    break
            else:
                self.poses, self.errors = self._moved(length * step)
                last, decrease, error = decrease, error - after, after
            is_stuck = length < MIN_STEP_FRACTION
            was_new, is_stale = is_stale, is_stuck or decrease > REFACTORISE_RATIO * last
            if (is_stuck and was_new) or (not decrease > unchanged and (was_new or not is_stale)):
                return

    def sample(self, rng: np.random.Generator, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """(K, 6, S) samples of the poses' errors; for fixed poses, they are taken from ``samples``.

        Each sample is the solution of the problem with random errors in all constraints.
        """
        gradient = np.zeros((self._size, SAMPLES))
        before, after, errors = self.constraints.jacobians(self.poses)
        weight = self._weights(self.constraints.residuals(self.poses, self.errors))
        c, root = self.constraints, np.sqrt(weight)[:, None, None]
        noise = rng.normal(size=(len(weight), 6, SAMPLES))
        for ends, J in ((c.first, before), (c.second, after)):
            fixed = ~self.free[ends]
            noise[fixed] -= root[fixed] * (J[fixed] @ samples[ends[fixed]])
        for ends, J in ((c.first, before), (c.second, after)):
            chosen = self.free[ends]
            self._add(gradient, ends[chosen], root[chosen] * (J[chosen].swapaxes(1, 2) @ noise[chosen]))
        if self.frees_errors:
            gradient[self._variables :] = np.einsum("nri,nrs->is", root * errors, noise)
            gradient[self._variables :] += self._prior_whitening.T @ rng.normal(size=(ERROR_COUNT, SAMPLES))
        upright = self._gravity_jacobians().swapaxes(1, 2) @ rng.normal(size=(int(self.free.sum()), 2, SAMPLES))
        gradient[: self._variables] += np.concatenate([upright, np.zeros_like(upright)], axis=1).reshape(-1, SAMPLES)
        if self.free[0]:
            gradient[:6] += self._start_whitening[:, None] * rng.normal(size=(6, SAMPLES))
        result = samples.copy()
        result[self.free] = self._factor.solve(gradient)[: self._variables].reshape(-1, 6, SAMPLES)
        return result

    def error_covariance(self) -> Covariance:
        """(7, 7) covariance of the systematic errors."""
        unit = np.zeros((self._size, ERROR_COUNT))
        unit[self._variables :] = np.eye(ERROR_COUNT)
        covariance = self._factor.solve(unit)[self._variables :]
        return (covariance + covariance.T) / 2

    def _weights(self, residuals: NDArray[np.float64]) -> Values:
        """(N,) weight of each constraint, by how well it fits."""
        return weights_of(np.square(residuals).sum(axis=1), self._scale)

    def _gravity_jacobians(self) -> NDArray[np.float64]:
        """(F, 2, 3) whitened Jacobians of the free keyframes' verticals w.r.t. their rotations."""
        R, u = self.poses[self.free, :3, :3], self.ups[self.free]
        cross = np.zeros((len(u), 3, 3))
        cross[:, [2, 0, 1], [1, 2, 0]] = u
        cross -= cross.swapaxes(1, 2)
        return np.asarray(-self._gravity_weight * (R @ cross)[:, :2])

    def _error(self, poses: Poses, errors: Values) -> float:
        """Half the sum of the losses of all residuals."""
        chi2 = self.constraints.chi2(poses, errors)
        loss = (self._scale * chi2 / (self._scale + chi2)).sum()
        loss += np.square(self._gravity_residuals(poses)).sum()
        if self.free[0]:
            loss += np.square(self._start_residual(poses)).sum()
        return float(loss + np.square(self._prior_whitening @ (errors - self.prior_errors.errors)).sum()) / 2

    def _gravity_residuals(self, poses: Poses) -> NDArray[np.float64]:
        """(F, 2) whitened horizontal parts of the free keyframes' verticals, in ``map``."""
        horizontal = np.einsum("nij,nj->ni", poses[self.free, :2, :3], self.ups[self.free])
        return np.asarray(self._gravity_weight * horizontal)

    def _start_residual(self, poses: Poses) -> Values:
        T = np.linalg.solve(self.start, poses[0])
        return np.asarray(self._start_whitening * np.append(Rotation.from_matrix(T[:3, :3]).as_rotvec(), T[:3, 3]))

    def _moved(self, step: Values) -> tuple[Poses, Values]:
        """The poses and errors after a step."""
        poses, delta = self.poses.copy(), step[: self._variables].reshape(-1, 6)
        T = poses[self.free]
        T[:, :3, 3] += np.einsum("nij,nj->ni", T[:, :3, :3], delta[:, 3:])
        T[:, :3, :3] = T[:, :3, :3] @ Rotation.from_rotvec(delta[:, :3]).as_matrix()
        poses[self.free] = T
        return poses, self.errors + step[self._variables :] if self.frees_errors else self.errors

    def _linearised(self, factorises: bool) -> Values:
        """The negative gradient of the error; ``factorises``: whether the information is factorised again, too."""
        c, size = self.constraints, self._size
        before, after, errors = c.jacobians(self.poses)
        residuals = c.residuals(self.poses, self.errors)
        weight = self._weights(residuals)
        gradient, blocks = np.zeros((size, 1)), list[tuple[Indices, Indices, NDArray[np.float64]]]()
        # Constraints between keyframes.
        ends = (c.first, before), (c.second, after)
        for one, J in ends:
            free = self.free[one]
            left = weight[free, None, None] * J[free].swapaxes(1, 2)
            self._add(gradient, one[free], -left @ residuals[free][..., None])
            for other, K in ends if factorises else ():
                both = self.free[other[free]]
                blocks.append((self._at[one[free][both]], self._at[other[free][both]], left[both] @ K[free][both]))
        # Gravity, and the pose of the first keyframe.
        rows, free_keyframes = self._gravity_jacobians(), np.arange(int(self.free.sum()))
        whole = np.tile(self.config.graph.prior_information * np.eye(6), (len(rows), 1, 1))
        whole[:, :3, :3] += rows.swapaxes(1, 2) @ rows
        pull = np.zeros((len(rows), 6))
        pull[:, :3] = -np.einsum("nri,nr->ni", rows, self._gravity_residuals(self.poses))
        gradient[: self._variables, 0] += pull.ravel()
        if self.free[0]:
            whole[0] += np.diag(self._start_whitening**2)
            gradient[:6, 0] -= self._start_whitening * self._start_residual(self.poses)
        blocks.append((free_keyframes, free_keyframes, whole))
        # The odometry's systematic errors.
        if self.frees_errors:
            left = weight[:, None, None] * errors.swapaxes(1, 2)
            gradient[self._variables :, 0] -= np.einsum("nir,nr->i", left, residuals)
            gradient[self._variables :, 0] -= (
                self._prior_whitening.T @ self._prior_whitening @ (self.errors - self.prior_errors.errors)
            )
        if factorises:
            information = _sparse(blocks, size)
            if self.frees_errors:
                information = information + self._error_information(ends, errors, left)
            options = {"SymmetricMode": True}
            self._factor: SuperLU = splu(information, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        return gradient[:, 0]

    def _error_information(
        self,
        ends: tuple[tuple[Indices, NDArray[np.float64]], ...],
        errors: NDArray[np.float64],
        left: NDArray[np.float64],
    ) -> csc_array:
        """The rows and columns of the information that belong to the systematic errors.

        Args:
            ends: for both ends of the constraints, the keyframe of each and the Jacobian w.r.t. its pose.
            errors: Jacobians w.r.t. the systematic errors.
            left: the Jacobians w.r.t. the systematic errors, weighted and transposed.
        """
        size, first = self._size, self._variables
        dense = np.zeros((size, ERROR_COUNT))
        for keyframe, J in ends:
            free = self.free[keyframe]
            self._add(dense, keyframe[free], (left[free] @ J[free]).swapaxes(1, 2))
        dense[first:] = (np.einsum("nir,nrj->ij", left, errors) + self._prior_whitening.T @ self._prior_whitening) / 2
        rows, columns = np.nonzero(np.ones_like(dense))
        part = coo_array((dense.ravel(), (rows, first + columns)), shape=(size, size))
        return (part + part.T).tocsc()

    def _add(self, target: NDArray[np.float64], keyframes: Indices, values: NDArray[np.float64]) -> None:
        """Add values (N, 6, C) to the rows of ``target`` (V, C) that belong to the keyframes."""
        whole = target[: self._variables].reshape(-1, 6, target.shape[1])
        np.add.at(whole, self._at[keyframes], values)


def _sparse(blocks: list[tuple[Indices, Indices, NDArray[np.float64]]], size: int) -> csc_array:
    """A sparse matrix from 6 × 6 blocks, each at a block row and column."""
    row, column, values = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    i, j = np.indices((6, 6))
    at = (6 * row[:, None, None] + i).ravel(), (6 * column[:, None, None] + j).ravel()
    return coo_array((values.ravel(), at), shape=(size, size)).tocsc()


def pose_sigmas(deviation: float, typical_range: float) -> Values:
    """(6,) rad and m, deviations of a pose that each move a point ``typical_range`` m away by ``deviation`` m."""
    return np.repeat([deviation / typical_range, deviation], 3)
