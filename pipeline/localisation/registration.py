"""Registration of a frame with points seen before, using GICP and priors of the frame's pose.

GICP (Segal, Haehnel and Thrun 2009) measures a pose only in the directions that surfaces determine. Odometry and
gravity are Gaussians in the same tangent space, so each Gauss-Newton step weights all three by their information. A
pair of points measures only the distance perpendicular to its surface; along the surface, the nearest point would
always suggest that the robot has not moved. Along a corridor, odometry therefore determines the position without a
special rule.

Tangent vectors hold rotation before translation and act on the right, T · Exp(δ), as in small_gicp and GTSAM.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import EllipsisType

import gtsam
import numpy as np
import small_gicp
from numpy.typing import NDArray

from pipeline.arrays import Covariance, Directions, Indices, Information, Mask, Place, Places, Points, Pose
from pipeline.geometry.thinning import voxel_means
from pipeline.localisation.config import RegistrationConfig
from pipeline.localisation.gates import chi2_gate
from pipeline.transforms import orthonormal, transform_places


@dataclass(frozen=True, eq=False)
class Prior:
    """Gaussian prior of a pose.

    Attributes:
        T: mean.
        information: inverse covariance, in the tangent space at the mean.
    """

    T: Pose
    information: Information


@dataclass(frozen=True, eq=False)
class KeyframeEvidence:
    """The source's pose according to the part of the target that one keyframe owns.

    Attributes:
        owner: index of the keyframe.
        T: pose of the source in the target's frame, from the keyframe's points alone.
        information: information of the pose, in the tangent space at ``T``.
    """

    owner: int
    T: Pose
    information: Information


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Points on surfaces, which can be registered like a frame's cloud.

    Attributes:
        at: (N, 3) m, the points.
        facing: (N, 3) unit normals, on the side from which the surfaces were seen.
    """

    at: Places
    facing: Directions

    def points(self) -> Places:
        """The points; the method has the same name in ``small_gicp.PointCloud``."""
        return self.at

    def normals(self) -> Directions:
        """The normals; the method has the same name in ``small_gicp.PointCloud``."""
        return self.facing

    def size(self) -> int:
        """Number of points."""
        return len(self.at)


class Target:
    """Points with which a source is registered.

    Attributes:
        points: the points, in the target's frame.
        normals: surface normals at the points.
        owner: index of the keyframe that owns each point.
        weight: weight of each point in registration, at most 1; uncertain points have lower weights.
        tree: k-d tree of the points.
    """

    def __init__(
        self, points: Places, normals: Directions, owner: Indices, weight: NDArray[np.float64] | None = None
    ) -> None:
        self.points, self.normals, self.owner = points, normals, owner
        self.weight = np.ones(len(points)) if weight is None else weight
        self.tree = small_gicp.KdTree(points)


@dataclass(frozen=True, eq=False)
class Registration:
    """Result of the registration of a source with a target.

    Attributes:
        T: pose of the source in the target's frame, fused from GICP and the priors.
        information: information from GICP alone, in the tangent space at ``T``.
        covariance: covariance of ``T`` from GICP and the priors.
        overlap: fraction of the source's points with a corresponding target point.
        chi2: squared Mahalanobis distance of ``T`` from the priors.
        prior_information: summed information of the priors.
        fits: whether ``T`` is close enough to the priors to be consistent with them.
        is_sure: whether ``T`` is consistent with the priors, and the overlap is too large to be due to chance.
    """

    T: Pose
    information: Information
    covariance: Covariance
    overlap: float
    chi2: float
    prior_information: Information
    fits: bool
    is_sure: bool

    @property
    def surprise(self) -> float:
        """Negative log marginal likelihood of the motion under the priors, in Laplace's approximation.

        A vaguer prior fits more motions, but is penalised for its volume in the directions that surfaces determine
        (MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapter 28).
        """
        return self.chi2 / 2 + occam_factor(self.prior_information, self.information)


def occam_factor(prior: Information, information: Information) -> float:
    """Logarithm of the ratio of a prior's volume to the posterior's."""
    return float(np.linalg.slogdet(prior + information)[1] - np.linalg.slogdet(prior)[1]) / 2


def cloud_of(points: Points, config: RegistrationConfig) -> small_gicp.PointCloud:
    """A thinned cloud with normals, made from points (N, 3) in any frame."""
    cloud = small_gicp.PointCloud(voxel_means(points, config.voxel))
    small_gicp.estimate_normals(cloud, num_neighbors=config.normal_neighbours)
    return cloud


def logarithm(T: NDArray[np.floating]) -> NDArray[np.float64]:
    """(6,) tangent vector of a 4×4 transform, rad and m."""
    return np.asarray(gtsam.Pose3.Logmap(gtsam.Pose3(T)))


def exponential(tangent: NDArray[np.float64]) -> Pose:
    """The 4×4 transform with a given tangent vector (6,), rad and m."""
    return np.asarray(gtsam.Pose3.Expmap(tangent).matrix())


def register(
    target: Target,
    source: small_gicp.PointCloud | Surfaces,
    priors: Sequence[Prior],
    farthest: float,
    config: RegistrationConfig,
) -> Registration:
    """Register a source with a target, starting at the mean of the first prior.

    Args:
        target: the points to register with, in ``map``.
        source: thinned cloud with normals, in its own frame.
        priors: priors of the source's pose in ``map``, which together must determine the pose.
        farthest: initial maximum distance between corresponding points, m.
        config: settings of the registration.
    """
    # Gauss-Newton steps: pair points within ever smaller distances, and fuse their information with the priors.
    T = priors[0].T
    for gate in np.repeat(np.unique([config.fine, config.coarse, farthest])[::-1], config.iterations):
        pairs = _Pairs(target, source, T, gate, config, target.weight)
        information, pull = pairs.measure()
        total = information.copy()
        for prior in priors:
            total = total + prior.information
            pull = pull + prior.information @ logarithm(np.linalg.solve(T, prior.T))
        T = T @ exponential(np.asarray(np.linalg.solve(total, pull)))
    # Compute the pose's distance from the priors, its covariance and its overlap.
    T = orthonormal(T)
    offsets = [logarithm(np.linalg.solve(T, prior.T)) for prior in priors]
    chi2 = sum(float(o @ p.information @ o) for o, p in zip(offsets, priors, strict=True))
    covariance = np.asarray(np.linalg.inv(total))
    overlap = float(np.mean(pairs.squared_distances < config.fine**2))
    prior = np.sum([prior.information for prior in priors], axis=0)
    fits = chi2 <= chi2_gate(len(covariance), config.confidence)
    is_sure = fits and overlap >= config.chance_overlap
    return Registration(T, information, covariance, overlap, chi2, prior, fits, is_sure)


def evidence_by_keyframe(
    target: Target, source: small_gicp.PointCloud, T: Pose, config: RegistrationConfig
) -> tuple[list[KeyframeEvidence], Mask]:
    """The evidence of each keyframe that owns points of the target, and a mask of the source's new points.

    Args:
        target, source: see :func:`register`.
        T: pose of the source in the target's frame.
        config: settings of the registration.

    Returns:
        The keyframes' evidence, the most informative first, and an (N,) mask of the source points that have no target
        point within the edge length of a voxel.
    """
    pairs = _Pairs(target, source, T, config.fine, config, np.ones(len(target.points)))
    owner = target.owner[pairs.target]
    evidence = []
    for one in np.unique(owner):
        H, pull = pairs.measure(owner == one)
        # Adding the identity fixes the directions that a few points leave undetermined, because the minimum along
        # such a direction is meaningless.
        delta = np.linalg.solve(H + np.eye(len(H)), pull)
        evidence.append(KeyframeEvidence(int(one), T @ exponential(np.asarray(delta)), H))
    return sorted(evidence, key=lambda e: -np.trace(e.information)), pairs.squared_distances > config.voxel**2


class _Pairs:
    """Corresponding points, and their information about the source's pose.

    The information of a point, J(n)ᵀ J(n), is biased by the square of the noise in its normal n, so that a bare floor
    would falsely suggest that the robot does not move. The noise in the two normals n and m of a pair is independent,
    so J(n)ᵀ J(m) is unbiased (the method of instrumental variables).

    Attributes:
        source, target: (P,) indices of the paired points; the points of a pair lie on one surface.
        squared_distances: (N,) squared distance from each source point to the nearest target point, m².
        rows: for the target's and for the source's normals, (P, 6) whitened Jacobian with respect to the pose, in its
            tangent space, and (P,) residuals.
    """

    def __init__(
        self,
        target: Target,
        source: small_gicp.PointCloud | Surfaces,
        T: Pose,
        gate: float,
        config: RegistrationConfig,
        weight: NDArray[np.float64],
    ) -> None:
        """Pair points closer than ``gate`` m, with the source at ``T``; ``weight``: weight of each target point."""
        points, R = source.points()[:, :3], T[:3, :3]
        at = transform_places(T, points)
        index, self.squared_distances = map(np.array, target.tree.batch_nearest_neighbor_search(at))
        near = np.flatnonzero(self.squared_distances < gate**2)
        n, m = target.normals[index[near]], source.normals()[near, :3] @ R.T
        cosine = np.einsum("ni,ni->n", n, m)
        # The normals of a frame's cloud have arbitrary signs; its target has only surfaces that face the camera.
        alike = (cosine if isinstance(source, Surfaces) else np.abs(cosine)) > config.min_normal_cosine
        self.source, self.target = near[alike], index[near[alike]]
        away = target.points[self.target] - at[self.source]
        self.rows = []
        root = np.sqrt(weight[self.target])[:, None] / config.surface_sigma
        for normals in (n[alike], np.sign(cosine[alike])[:, None] * m[alike]):
            u = normals * root
            J = np.hstack([np.cross(u @ R, points[self.source]), -u @ R])
            self.rows.append((J, np.einsum("ni,ni->n", u, away)))
        self._scale = np.repeat([config.typical_range, 1.0], 3)
        self._whole = self._scaled()
        strength, directions = np.linalg.eigh(self._whole[0])
        self._min_strength = config.min_strength * strength[-1]
        self._determined = directions[:, strength > self._min_strength]

    def measure(self, rows: Mask | EllipsisType = ...) -> tuple[Information, NDArray[np.float64]]:
        """Information of the pose and information vector (6,) from the pairs in ``rows`` (P,).

        Only directions that all pairs together determine are used, because in other directions, such as along a
        corridor, the pairs measure only noise. This noise is small, but similar in every keyframe.
        """
        H, pull = self._whole if rows is ... else self._scaled(rows)
        strength, directions = np.linalg.eigh(self._determined.T @ H @ self._determined)
        real = np.clip(1 - self._min_strength / np.maximum(strength, np.finfo(np.float64).eps), 0, 1)
        scaled = self._scale[:, None] * (self._determined @ directions)
        return scaled * (strength * real) @ scaled.T, scaled @ (real * ((self._determined @ directions).T @ pull))

    def _scaled(self, rows: Mask | EllipsisType = ...) -> tuple[Information, NDArray[np.float64]]:
        """Information and information vector (6,) in all directions, with rotations times ``typical_range``, m."""
        (J_n, r_n), (J_m, r_m) = ((J[rows] / self._scale, residual[rows]) for J, residual in self.rows)
        return (J_n.T @ J_m + J_m.T @ J_n) / 2, -(J_n.T @ r_m + J_m.T @ r_n) / 2


def front_normals(cloud: small_gicp.PointCloud, camera: Place) -> Directions:
    """(N, 3) unit normals of a cloud's points, oriented towards the ``camera`` (3,) that saw them."""
    normals = np.array(cloud.normals())[:, :3]
    away = np.einsum("ni,ni->n", normals, camera - cloud.points()[:, :3]) < 0
    return np.where(away[:, None], -normals, normals)
