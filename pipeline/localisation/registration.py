"""Registration: where a frame fits the points seen before, by GICP and what odometry and gravity say.

GICP (Segal, Haehnel and Thrun 2009) measures the pose as well as the surfaces allow, and odometry the rest: both are
Gaussians on one tangent space, so they are fused by their information. Along a corridor GICP's information is nil,
and the direction stays with the odometry without a rule for corridors.

Tangents are rotation, then translation, on the right: T · Exp(δ), as small_gicp and GTSAM have them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
import small_gicp
from numpy.typing import NDArray

VOXEL = 0.05
"""m; clouds are thinned to one point in a voxel, the mean of its returns."""
NEIGHBOURS = 20
"""Of a point, from which its surface's direction is estimated."""
GATES = (0.2, 0.2, 0.2, 0.1, 0.1, 0.1, 0.1, 0.1)
"""m, greatest distance of corresponding points, round by round."""
ITERATIONS = 10
"""Of Gauss-Newton in a round, at most."""
INDEPENDENT = 0.02
"""Share of the points that err independently: neighbours share the sensor's and the map's errors. By NEES."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of a pose before registration: a Gaussian.

    Attributes:
        T: 4×4 mean.
        information: (6, 6) inverse covariance in the tangent at the mean, 1/rad² and 1/m².
    """

    T: NDArray[np.float64]
    information: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Registration:
    """A frame's place among the target's points.

    Attributes:
        T: 4×4 pose of the source in the target's frame, GICP and priors fused.
        information: (6, 6) of GICP alone in the tangent at ``T``.
        overlap: share of the source's points with a corresponding one.
        chi2: how far GICP and priors lie apart, squared Mahalanobis distance with six degrees of freedom.
    """

    T: NDArray[np.float64]
    information: NDArray[np.float64]
    overlap: float
    chi2: float


def cloud_of(points: NDArray) -> small_gicp.PointCloud:
    """A thinned cloud with covariances from (N, 3) points, m."""
    cloud = small_gicp.voxelgrid_sampling(points.astype(np.float64), VOXEL)
    small_gicp.estimate_normals_covariances(cloud, num_neighbors=NEIGHBOURS)
    return cloud


def logarithm(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """(6,) the tangent of a 4×4 transform."""
    return np.asarray(gtsam.Pose3.Logmap(gtsam.Pose3(T)))


def exponential(tangent: NDArray[np.float64]) -> NDArray[np.float64]:
    """The 4×4 transform of a tangent (6,)."""
    return np.asarray(gtsam.Pose3.Expmap(tangent).matrix())


def register(
    target: small_gicp.PointCloud, tree: small_gicp.KdTree, source: small_gicp.PointCloud, priors: Sequence[Prior]
) -> Registration:
    """Fit a source to a target, beginning at the first prior.

    Args:
        target: with covariances, m in ``map``.
        tree: of the target.
        source: with covariances, m in its own frame.
        priors: of the source's pose in ``map``; together they must determine it.
    """
    T = priors[0].T
    for gate in GATES:
        step = small_gicp.align(
            target, source, tree, T, max_correspondence_distance=gate, num_threads=1, max_iterations=1
        )
        information, gradient = INDEPENDENT * step.H, INDEPENDENT * step.b.ravel()
        total, pull = information.copy(), -gradient
        for prior in priors:
            total += prior.information
            pull = pull + prior.information @ logarithm(np.linalg.solve(T, prior.T))
        delta = np.linalg.solve(total, pull)
        T = T @ exponential(delta)
    offsets = [logarithm(np.linalg.solve(T, prior.T)) for prior in priors]
    chi2 = sum(o @ p.information @ o for o, p in zip(offsets, priors, strict=True))
    return Registration(T, information, step.num_inliers / source.size(), float(chi2))


def shares(
    target: small_gicp.PointCloud,
    tree: small_gicp.KdTree,
    source: small_gicp.PointCloud,
    T: NDArray[np.float64],
    owner: NDArray[np.int64],
) -> tuple[dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]], NDArray[np.bool_]]:
    """What each keyframe that owns points of the target says of the source's pose, and which points are new.

    Args:
        target, tree, source: see :func:`register`.
        T: 4×4 pose of the source, at which GICP is linearised.
        owner: (M,) the keyframe of every point of the target.

    Returns:
        (6, 6) information and (6,) gradient of GICP's cost in the tangent at ``T``, by owner, and (N,) bool the
        points of the source that have no point of the target within ``VOXEL``.
    """
    points = source.points()[:, :3]
    R = T[:3, :3]
    index, squared = (np.array(values) for values in tree.batch_nearest_neighbor_search(points @ R.T + T[:3, 3]))
    near = squared < GATES[-1] ** 2
    n, m = np.flatnonzero(near), index[near]
    C = np.array(target.covs())[m, :3, :3] + R @ np.array(source.covs())[n, :3, :3] @ R.T
    weight = np.linalg.inv(C) - 0.5 * np.eye(3)
    residual = target.points()[m, :3] - points[n] @ R.T - T[:3, 3]
    J = np.concatenate([R @ skew(points[n]), np.broadcast_to(-R, (len(n), 3, 3))], axis=2)
    JW = J.transpose(0, 2, 1) @ weight
    H, b = INDEPENDENT * JW @ J, INDEPENDENT * (JW @ residual[:, :, None])[:, :, 0]
    order = np.argsort(owner[m], kind="stable")
    owners, first = np.unique(owner[m][order], return_index=True)
    H, b = np.add.reduceat(H[order], first), np.add.reduceat(b[order], first)
    return {int(o): (h, g) for o, h, g in zip(owners, H, b, strict=True)}, squared > VOXEL**2


def skew(v: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3) matrices that make the cross product with (N, 3) vectors."""
    x, y, z = v.T
    o = np.zeros(len(v))
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=1).reshape(-1, 3, 3)


def front(cloud: small_gicp.PointCloud, camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) normals of a cloud's points, on the side of the camera (3,) that saw them."""
    normals = np.array(cloud.normals())[:, :3]
    away = np.einsum("ni,ni->n", normals, camera - cloud.points()[:, :3]) < 0
    normals[away] *= -1
    return normals
