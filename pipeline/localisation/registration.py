"""Registration: where a frame fits the points seen before, by GICP and by what else is known of its pose.

GICP (Segal, Haehnel and Thrun 2009) measures a pose as far as the surfaces determine it. Odometry and gravity are
Gaussians on the same tangent space, so each Gauss-Newton step weighs all of them by their information. Along a
corridor GICP has none, and the direction stays with the odometry without a rule for corridors.

Tangents are rotation, then translation, on the right, T · Exp(δ), as small_gicp and GTSAM have them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
import small_gicp
from numpy.typing import NDArray

from pipeline.transforms import orthonormal

VOXEL = 0.05
"""m; clouds are thinned to the mean of the returns of a voxel."""
NEIGHBOURS = 20
"""Of a point, from which the direction of its surface is estimated."""
GATES = (0.2, 0.2, 0.2, 0.1, 0.1, 0.1, 0.1, 0.1)
"""m, greatest distance of corresponding points, step by step."""
WEIGHT = 3.0
"""Information over that of small_gicp, which has points on a surface stray by 3 cm, each on its own. Ours stray less,
but not each on its own: on drives with known poses the normalised estimation error squared of the motion between
keyframes is 0.3 per dimension, on the safe side of 1."""
TANGENTIAL = 0.5
"""Of GICP's weight of a pair in every direction, also along the surface, where a pair says nothing."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of a pose beside registration: a Gaussian.

    Attributes:
        T: 4×4 mean.
        information: (6, 6) inverse covariance in the tangent at the mean, 1/rad² and 1/m².
    """

    T: NDArray[np.float64]
    information: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Share:
    """What a part of the target says of the source's pose.

    Attributes:
        owner: of these points of the target.
        T: 4×4 pose of the source in the target's frame, at which these points alone would have it.
        information: (6, 6) in the tangent at ``T``.
    """

    owner: int
    T: NDArray[np.float64]
    information: NDArray[np.float64]


class Target:
    """Points to register with.

    Attributes:
        owner: (M,) int64 whose each point is.
    """

    def __init__(self, points: NDArray[np.float64], owner: NDArray[np.int64]):
        """(M, 3) points, m."""
        self.owner = owner
        self.cloud = small_gicp.PointCloud(points)
        self.tree = small_gicp.KdTree(self.cloud)
        small_gicp.estimate_covariances(self.cloud, self.tree, num_neighbors=NEIGHBOURS)


@dataclass(frozen=True, eq=False)
class Registration:
    """A frame's place among the target's points.

    Attributes:
        T: 4×4 pose of the source in the target's frame, GICP and priors fused.
        information: (6, 6) of GICP alone in the tangent at ``T``.
        covariance: (6, 6) of GICP and priors, rad² and m².
        overlap: share of the source's points with a corresponding one.
        chi2: squared Mahalanobis distance of ``T`` from the priors.
    """

    T: NDArray[np.float64]
    information: NDArray[np.float64]
    covariance: NDArray[np.float64]
    overlap: float
    chi2: float


def cloud_of(points: NDArray) -> small_gicp.PointCloud:
    """A thinned cloud with normals and covariances from (N, 3) points, m."""
    cloud = small_gicp.voxelgrid_sampling(points.astype(np.float64), VOXEL)
    small_gicp.estimate_normals_covariances(cloud, num_neighbors=NEIGHBOURS)
    return cloud


def logarithm(T: NDArray[np.floating]) -> NDArray[np.float64]:
    """(6,) the tangent of a 4×4 transform."""
    return np.asarray(gtsam.Pose3.Logmap(gtsam.Pose3(T)))


def exponential(tangent: NDArray[np.float64]) -> NDArray[np.float64]:
    """The 4×4 transform of a tangent (6,)."""
    return np.asarray(gtsam.Pose3.Expmap(tangent).matrix())


def register(
    target: Target, source: small_gicp.PointCloud, priors: Sequence[Prior], gates: Sequence[float] = GATES
) -> Registration:
    """Fit a source to a target, beginning at the first prior.

    Args:
        target: in ``map``.
        source: thinned, with covariances, in its own frame.
        priors: of the source's pose in ``map``; together they must determine it.
        gates: m, greatest distance of corresponding points in each step.
    """
    T = priors[0].T
    for gate in gates:
        step = small_gicp.align(
            target.cloud, source, target.tree, T, max_correspondence_distance=gate, num_threads=1, max_iterations=1
        )
        total, pull = WEIGHT * step.H, -WEIGHT * step.b.ravel()
        for prior in priors:
            total = total + prior.information
            pull = pull + prior.information @ logarithm(np.linalg.solve(T, prior.T))
        T = T @ exponential(np.linalg.solve(total, pull))
    T = orthonormal(T)
    offsets = [logarithm(np.linalg.solve(T, prior.T)) for prior in priors]
    chi2 = sum(float(o @ p.information @ o) for o, p in zip(offsets, priors, strict=True))
    overlap = step.num_inliers / source.size()
    return Registration(T, WEIGHT * step.H, np.linalg.inv(total), overlap, chi2)


def shares_of(
    target: Target, source: small_gicp.PointCloud, T: NDArray[np.float64]
) -> tuple[list[Share], NDArray[np.bool_]]:
    """What each owner of the target's points says of a registered source, and which of its points are new.

    Args:
        target, source: see :func:`register`.
        T: 4×4 pose of the source in the target's frame.

    Returns:
        The shares, the most informative one first, and (N,) bool, the points without one of the target in ``VOXEL``.
    """
    points, R = source.points()[:, :3], T[:3, :3]
    index, squared = map(np.array, target.tree.batch_nearest_neighbor_search(points @ R.T + T[:3, 3]))
    n = np.flatnonzero(squared < GATES[-1] ** 2)
    n = n[np.argsort(target.owner[index[n]], kind="stable")]
    m = index[n]
    C = np.array(target.cloud.covs())[m, :3, :3] + R @ np.array(source.covs())[n, :3, :3] @ R.T
    residual = target.cloud.points()[m, :3] - points[n] @ R.T - T[:3, 3]
    J = np.concatenate([R @ _cross_matrices(points[n]), np.broadcast_to(-R, (len(n), 3, 3))], axis=2)
    JW = WEIGHT * J.transpose(0, 2, 1) @ (np.linalg.inv(C) - TANGENTIAL * np.eye(3))
    owners, first = np.unique(target.owner[m], return_index=True)
    shares = []
    for owner, H, b in zip(
        owners, *(np.add.reduceat(x, first) for x in (JW @ J, JW @ residual[:, :, None])), strict=True
    ):
        # The one makes up for what a few points leave open: there the share's own minimum means nothing.
        delta = np.linalg.solve(H + np.eye(6), -b[:, 0])
        shares.append(Share(int(owner), T @ exponential(delta), H))
    return sorted(shares, key=lambda share: -np.trace(share.information)), squared > VOXEL**2


def front_normals(cloud: small_gicp.PointCloud, camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) unit normals of a cloud's points, on the side of the camera (3,) that saw them."""
    normals = np.array(cloud.normals())[:, :3]
    away = np.einsum("ni,ni->n", normals, camera - cloud.points()[:, :3]) < 0
    return np.where(away[:, None], -normals, normals)


def _cross_matrices(v: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3) matrices that make the cross product with (N, 3) vectors."""
    x, y, z = v.T
    o = np.zeros(len(v))
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=1).reshape(-1, 3, 3)
