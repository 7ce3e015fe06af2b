"""Planes through three points, found by RANSAC, or fitted by least squares.

A plane consists of the points x with n · x = d, where the unit vector n points to the side from which the surface was
seen. As an array, a plane is [n, d]. In ``camera_optical``, this side contains the origin, so d ≤ 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Direction, Indices, Mask, Place, Places, Planes, Points, Pose, Values


@dataclass(frozen=True, eq=False)
class Plane:
    """The points x with ``normal · x = offset``.

    Attributes:
        normal: unit normal, towards the camera that saw the surface.
        offset: signed distance from the origin along the normal, m.
    """

    normal: Direction
    offset: float

    def distance(self, points: NDArray[np.floating]) -> Values:
        """(N,) m, signed distances of points (N, 3) from the plane, positive on the camera's side."""
        return points @ self.normal - self.offset

    def projected(self, points: Places) -> Places:
        """(N, 3) points, m, projected orthogonally onto the plane."""
        return points - self.distance(points)[:, None] * self.normal

    def facing(self, direction: Direction) -> "Plane":
        """The same plane, with its normal on the side to which ``direction``, a vector of any length, points."""
        return self if self.normal @ direction >= 0 else Plane(-self.normal, -self.offset)


def distances(points: NDArray[np.floating], planes: NDArray[np.floating]) -> NDArray[np.floating]:
    """(N, P) or (N,) signed distances, m, of points (N, 3) from planes (P, 4) or (4,)."""
    return points @ planes[..., :3].T - planes[..., 3]


def planes_through(triples: NDArray[np.float64]) -> Planes:
    """(N, 4) planes, each through three points (N, 3, 3), m; NaN for collinear points."""
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    with np.errstate(invalid="ignore"):
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return np.concatenate([normals, np.sum(normals * triples[:, 0], axis=1, keepdims=True)], axis=1)


def ransac_plane(
    points: NDArray[np.floating],
    triples: Indices,
    tolerance: float | NDArray[np.floating],
    is_allowed: Callable[[Planes, NDArray[np.floating]], Mask] | None = None,
) -> tuple[Planes, Mask] | None:
    """The plane (4,) with the most inliers, and its inliers (N,), by RANSAC (Fischler & Bolles 1981).

    The normal of the plane is on the side of the origin. The same points and ``triples`` give the same result.

    Args:
        points: (N, 3) m, in any frame.
        triples: (S, 3) indices of the three points that define each candidate plane.
        tolerance: distance from a plane within which a point is an inlier, m; a scalar, or (N,) for each point.
        is_allowed: returns (S,) whether each plane may be chosen, given the planes (S, 4) and the points' signed
            distances from them (N, S), m.

    Returns:
        The plane and its inliers; None if no allowed plane has an inlier.
    """
    planes = facing_camera(planes_through(points[triples].astype(np.float64)))
    off = distances(points, planes.astype(points.dtype))
    near = np.abs(off) < np.reshape(tolerance, (-1, 1))
    counts = near.sum(axis=0) if is_allowed is None else np.where(is_allowed(planes, off), near.sum(axis=0), 0)
    best = int(counts.argmax())
    return (planes[best], near[:, best]) if counts[best] else None


def plane_inliers(points: Points, max_distance: float, samples: int, seed: int) -> Mask:
    """(N,) the inliers of a plane that is found by RANSAC and then refitted to its inliers.

    Args:
        points: at least three points, in any frame.
        max_distance: distance from the plane within which points are inliers, m.
        samples: number of random planes.
        seed: seed of the samples.
    """
    found = ransac_plane(points, np.random.default_rng(seed).integers(len(points), size=(samples, 3)), max_distance)
    if found is None:
        return np.zeros(len(points), np.bool_)
    plane, _ = Moments.of(points[found[1]]).fit(found[0][:3])
    return np.abs(plane.distance(points)) < max_distance


def facing_camera(planes: Planes) -> Planes:
    """Planes (P, 4) in ``camera_optical``, each normal turned towards the camera, so that d ≤ 0."""
    return np.where(planes[:, 3:] > 0, -planes, planes)


def transform_planes(T: Pose, planes: Planes) -> Planes:
    """The planes (P, 4) of points that ``T`` transforms."""
    normals = planes[:, :3] @ T[:3, :3].T
    return np.column_stack([normals, planes[:, 3] + normals @ T[:3, 3]])


@dataclass(frozen=True, eq=False)
class Moments:
    """Count, sum and sum of squares of points, which suffice to fit a least-squares plane; moments are additive.

    Attributes:
        count: number of points.
        total: (3,) float64 m, sum of the points, Σ x.
        squares: (3, 3) float64 m², sum of their outer products, Σ x xᵀ.
    """

    count: int
    total: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def of(cls, points: NDArray[np.floating]) -> Self:
        """The moments of (N, 3) points, m."""
        x = points.astype(np.float64)
        return cls(len(x), x.sum(axis=0), x.T @ x)

    def __add__(self, other: "Moments") -> "Moments":
        """The moments of the union of both sets of points."""
        return Moments(self.count + other.count, self.total + other.total, self.squares + other.squares)

    def moved(self, T: Pose) -> "Moments":
        """The moments of the points moved by ``T``."""
        R, t = T[:3, :3], T[:3, 3]
        total = R @ self.total
        mixed = np.outer(total, t)
        squares = R @ self.squares @ R.T + mixed + mixed.T + self.count * np.outer(t, t)
        return Moments(self.count, total + self.count * t, squares)

    @property
    def centroid(self) -> Place:
        """(3,) m, mean of the points."""
        return self.total / self.count

    def fit(self, towards: Direction) -> tuple[Plane, float]:
        """The plane with the least squared distances, facing ``towards``, and the RMS distance from it, m.

        Distances are orthogonal to the plane.
        """
        centroid = self.centroid
        covariance = self.squares / self.count - np.outer(centroid, centroid)
        variances, axes = np.linalg.eigh(covariance)
        plane = Plane(axes[:, 0], float(axes[:, 0] @ centroid)).facing(towards)
        return plane, float(np.sqrt(max(variances[0], 0.0)))
