"""Registration: where a frame fits the points seen before, by GICP and by what else is known of its pose.

GICP (Segal, Haehnel and Thrun 2009) measures a pose as far as the surfaces determine it. Odometry and gravity are
Gaussians on the same tangent space, so each Gauss-Newton step weighs all of them by their information. Along a
corridor GICP has no information, so the odometry decides there without a rule for corridors: a pair measures only the
distance across its surface. Along the surface, the nearest point would always suggest that the robot has not moved.

Tangents are rotation, then translation, on the right, T · Exp(δ), as in small_gicp and GTSAM.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import EllipsisType

import gtsam
import numpy as np
import small_gicp
from numpy.typing import NDArray

from pipeline.localisation.belief import evidence_of_overlap
from pipeline.localisation.gates import chi2_gate
from pipeline.localisation.pose_graph import LEVER
from pipeline.transforms import orthonormal

CLOUD_VOXEL = 0.05
"""m; clouds are thinned to the mean of the returns in each voxel."""
NORMAL_NEIGHBOURS = 20
"""Number of neighbours from which a point's normal is estimated."""
WIDEST, COARSE, FINE = 0.5, 0.2, 0.1
"""m, greatest distances of corresponding points: from a guess alone, from odometry, and at the end, two voxels."""
ROUNDS = 4
"""Steps of a registration with each of these distances."""
LEAST_POINTS = 100
"""Least number of points to register, and to register with."""
STRAY = 0.063
"""m, standard deviation of a pair's distance across its surface. Single points have less noise, but it is correlated
among the points of one keyframe, with which later ones are registered."""
SAME_SURFACE = 0.9
"""Least cosine between the normals of a pair on one surface."""
FEIGNED = 1e-3
"""Share of the strongest information; weaker information comes from noise and is left out."""
_SCALE = np.repeat([LEVER, 1.0], 3)


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of a pose apart from registration: a Gaussian.

    Attributes:
        T: 4×4 mean.
        information: (6, 6) inverse covariance in the tangent at the mean, 1/rad² and 1/m².
    """

    T: NDArray[np.float64]
    information: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Share:
    """The source's pose by the part of the target that one keyframe owns.

    Attributes:
        owner: number of the keyframe.
        T: 4×4 pose of the source in the target's frame by these points alone.
        information: (6, 6) in the tangent at ``T``.
    """

    owner: int
    T: NDArray[np.float64]
    information: NDArray[np.float64]


class Target:
    """Points to register with.

    Attributes:
        owner: (M,) int64 number of the keyframe that each point belongs to.
    """

    def __init__(self, points: NDArray[np.float64], owner: NDArray[np.int64]):
        """(M, 3) points, m."""
        self.owner = owner
        self.cloud = small_gicp.PointCloud(points)
        self.tree = small_gicp.KdTree(self.cloud)
        small_gicp.estimate_normals(self.cloud, self.tree, num_neighbors=NORMAL_NEIGHBOURS)


@dataclass(frozen=True, eq=False)
class Registration:
    """The pose of a source registered with a target.

    Attributes:
        T: 4×4 pose of the source in the target's frame, GICP and priors fused.
        information: (6, 6) of GICP alone in the tangent at ``T``.
        covariance: (6, 6) of GICP and priors, rad² and m².
        overlap: share of the source's points with a corresponding target point.
        chi2: squared Mahalanobis distance of ``T`` from the priors.
        prior: (6, 6) information of the priors together, 1/rad² and 1/m².
    """

    T: NDArray[np.float64]
    information: NDArray[np.float64]
    covariance: NDArray[np.float64]
    overlap: float
    chi2: float
    prior: NDArray[np.float64]

    @property
    def fits(self) -> bool:
        """Whether it is near enough to the priors not to disprove them."""
        return self.chi2 <= chi2_gate(len(self.covariance))

    @property
    def surprise(self) -> float:
        """Negative logarithm of the marginal likelihood of the motion under the priors, by Laplace's approximation.

        A prior that says less fits more, and pays for it by its volume as far as surfaces determine the pose
        (MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapter 28).
        """
        return self.chi2 / 2 + occam_factor(self.prior, self.information)

    @property
    def fit(self) -> float:
        """Logarithm of how much likelier a right pose explains the points that fit than chance does."""
        return evidence_of_overlap(self.overlap)

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the likelihood of the frame under the priors, up to a constant of the frame."""
        return self.fit - self.surprise


def occam_factor(prior: NDArray[np.float64], information: NDArray[np.float64]) -> float:
    """Logarithm of the ratio of a prior's volume to the posterior's, from (6, 6) information of both."""
    return float(np.linalg.slogdet(prior + information)[1] - np.linalg.slogdet(prior)[1]) / 2


def cloud_of(points: NDArray) -> small_gicp.PointCloud:
    """A thinned cloud with normals from (N, 3) points, m."""
    cloud = small_gicp.voxelgrid_sampling(points.astype(np.float64), CLOUD_VOXEL)
    small_gicp.estimate_normals(cloud, num_neighbors=NORMAL_NEIGHBOURS)
    return cloud


def logarithm(T: NDArray[np.floating]) -> NDArray[np.float64]:
    """(6,) the tangent of a 4×4 transform."""
    return np.asarray(gtsam.Pose3.Logmap(gtsam.Pose3(T)))


def exponential(tangent: NDArray[np.float64]) -> NDArray[np.float64]:
    """The 4×4 transform of a tangent (6,)."""
    return np.asarray(gtsam.Pose3.Expmap(tangent).matrix())


def register(
    target: Target, source: small_gicp.PointCloud, priors: Sequence[Prior], farthest: float = COARSE
) -> Registration:
    """Fit a source to a target, starting at the mean of the first prior.

    Args:
        target: in ``map``.
        source: thinned, with normals, in its own frame.
        priors: of the source's pose in ``map``; together they must determine it.
        farthest: m, greatest distance of corresponding points at first.
    """
    T = priors[0].T
    for gate in np.repeat(np.unique([FINE, COARSE, farthest])[::-1], ROUNDS):
        pairs = _Pairs(target, source, T, gate)
        information, pull = pairs.tell()
        total = information.copy()
        for prior in priors:
            total = total + prior.information
            pull = pull + prior.information @ logarithm(np.linalg.solve(T, prior.T))
        T = T @ exponential(np.asarray(np.linalg.solve(total, pull)))
    T = orthonormal(T)
    offsets = [logarithm(np.linalg.solve(T, prior.T)) for prior in priors]
    chi2 = sum(float(o @ p.information @ o) for o, p in zip(offsets, priors, strict=True))
    covariance = np.asarray(np.linalg.inv(total))
    overlap = float(np.mean(pairs.squared < FINE**2))
    prior = np.sum([prior.information for prior in priors], axis=0)
    return Registration(T, information, covariance, overlap, chi2, prior)


def shares_of(
    target: Target, source: small_gicp.PointCloud, T: NDArray[np.float64]
) -> tuple[list[Share], NDArray[np.bool_]]:
    """The share of each owner of the target's points in a registration, and which of the source's points are new.

    Args:
        target, source: see :func:`register`.
        T: 4×4 pose of the source in the target's frame.

    Returns:
        The shares, the most informative one first, and (N,) bool, the points without a target point
        within ``CLOUD_VOXEL``.
    """
    pairs = _Pairs(target, source, T, FINE)
    owner = target.owner[pairs.target]
    shares = []
    for one in np.unique(owner):
        H, pull = pairs.tell(owner == one)
        # The identity decides what a few points leave undetermined: there the share's own minimum is meaningless.
        delta = np.linalg.solve(H + np.eye(len(H)), pull)
        shares.append(Share(int(one), T @ exponential(np.asarray(delta)), H))
    return sorted(shares, key=lambda share: -np.trace(share.information)), pairs.squared > CLOUD_VOXEL**2


class _Pairs:
    """Corresponding points, and what they say of the source's pose.

    A normal n has noise, and J(n)ᵀ J(n), the information of a point on its surface, is biased by the square of it:
    bare floors falsely suggest that the robot does not move. The noise of the two normals n and m of a pair is
    independent, so J(n)ᵀ J(m) is unbiased (the method of instrumental variables).

    Attributes:
        source, target: (P,) indices of the points of each pair that lie on one surface.
        squared: (N,) m², squared distance from each source point to the nearest target point.
        rows: for the normals of either side, (P, 6) derivative by the pose, in the tangent, and (P,) residual.
    """

    def __init__(self, target: Target, source: small_gicp.PointCloud, T: NDArray[np.float64], gate: float):
        """Pair the points closer than ``gate`` m, with the source at a pose (4×4)."""
        points, R = source.points()[:, :3], T[:3, :3]
        at = points @ R.T + T[:3, 3]
        index, self.squared = map(np.array, target.tree.batch_nearest_neighbor_search(at))
        near = np.flatnonzero(self.squared < gate**2)
        n, m = target.cloud.normals()[index[near], :3], source.normals()[near, :3] @ R.T
        cosine = np.einsum("ni,ni->n", n, m)
        alike = np.abs(cosine) > SAME_SURFACE
        self.source, self.target = near[alike], index[near[alike]]
        away = target.cloud.points()[self.target, :3] - at[self.source]
        self.rows = []
        for normals in (n[alike], np.sign(cosine[alike])[:, None] * m[alike]):
            u = normals / STRAY
            J = np.hstack([np.cross(u @ R, points[self.source]), -u @ R])
            self.rows.append((J, np.einsum("ni,ni->n", u, away)))
        self._whole = self._scaled()
        strength, directions = np.linalg.eigh(self._whole[0])
        self._least = FEIGNED * strength[-1]
        self._known = directions[:, strength > self._least]

    def tell(self, rows: NDArray[np.bool_] | EllipsisType = ...) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(6, 6) information of the pose and (6,) information vector by the pairs in ``rows`` (P,).

        Only in the directions that all pairs determine: what some of them tell beyond these is noise. It is small,
        but along a corridor it is all there is, and it is alike in each keyframe.
        """
        H, pull = self._whole if rows is ... else self._scaled(rows)
        strength, directions = np.linalg.eigh(self._known.T @ H @ self._known)
        real = np.clip(1 - self._least / np.maximum(strength, np.finfo(np.float64).eps), 0, 1)
        scaled = _SCALE[:, None] * (self._known @ directions)
        return scaled * (strength * real) @ scaled.T, scaled @ (real * ((self._known @ directions).T @ pull))

    def _scaled(
        self, rows: NDArray[np.bool_] | EllipsisType = ...
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Information and information vector, noise included, of rotations times ``LEVER`` and translations, m."""
        (J_n, r_n), (J_m, r_m) = ((J[rows] / _SCALE, residual[rows]) for J, residual in self.rows)
        return (J_n.T @ J_m + J_m.T @ J_n) / 2, -(J_n.T @ r_m + J_m.T @ r_n) / 2


def front_normals(cloud: small_gicp.PointCloud, camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) unit normals of a cloud's points, on the side of the camera (3,) that saw them."""
    normals = np.array(cloud.normals())[:, :3]
    away = np.einsum("ni,ni->n", normals, camera - cloud.points()[:, :3]) < 0
    return np.where(away[:, None], -normals, normals)
