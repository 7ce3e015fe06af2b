"""A plane, and the sums from which it is fitted by least squares.

One convention holds for every plane: the points x with n · x = d, where n has length 1 and points to the side from
which the surface was seen. Four numbers in an array are [n, d]. In ``camera_optical`` that side contains the origin,
so d ≤ 0 there. Planes that a library returns in another convention are converted where it is called.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Plane:
    """The points x with ``normal · x = offset``.

    Attributes:
        normal: (3,) float64 of length 1, towards the camera that saw the surface.
        offset: m.
    """

    normal: NDArray[np.float64]
    offset: float

    def distance(self, points: NDArray) -> NDArray[np.float64]:
        """(N,) signed distance of (N, 3) points in m, positive on the camera's side."""
        return points @ self.normal - self.offset

    def projected(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) the points of the plane nearest to (N, 3) points, m."""
        return points - self.distance(points)[:, None] * self.normal

    def facing(self, direction: NDArray[np.float64]) -> "Plane":
        """The same plane with its normal on the side of ``direction`` (3,)."""
        return self if self.normal @ direction >= 0 else Plane(-self.normal, -self.offset)


def facing_camera(planes: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P, 4) planes [n, d] in ``camera_optical``, each normal turned towards the camera, so that d ≤ 0."""
    return np.where(planes[:, 3:] > 0, -planes, planes)


@dataclass(frozen=True, eq=False)
class Moments:
    """Count, sum and sum of squares of points, which suffice for a least-squares plane; moments of sets add up.

    Attributes:
        count: number of points.
        total: (3,) float64, Σ x.
        squares: (3, 3) float64, Σ x xᵀ.
    """

    count: int
    total: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def of(cls, points: NDArray) -> Self:
        """The moments of (N, 3) points."""
        x = points.astype(np.float64)
        return cls(len(x), x.sum(axis=0), x.T @ x)

    def __add__(self, other: "Moments") -> "Moments":
        """The moments of the union of both sets of points."""
        return Moments(self.count + other.count, self.total + other.total, self.squares + other.squares)

    def moved(self, T: NDArray[np.float64]) -> "Moments":
        """The moments of the points moved by the 4×4 transform ``T``."""
        R, t = T[:3, :3], T[:3, 3]
        total = R @ self.total
        mixed = np.outer(total, t)
        squares = R @ self.squares @ R.T + mixed + mixed.T + self.count * np.outer(t, t)
        return Moments(self.count, total + self.count * t, squares)

    @property
    def centroid(self) -> NDArray[np.float64]:
        """(3,) mean point, m."""
        return self.total / self.count

    def fit(self, towards: NDArray[np.float64]) -> tuple[Plane, float]:
        """The plane of least squared orthogonal distances, and their rms in m.

        Args:
            towards: (3,) a direction on the side to which the normal points.
        """
        centroid = self.centroid
        covariance = self.squares / self.count - np.outer(centroid, centroid)
        variances, axes = np.linalg.eigh(covariance)
        plane = Plane(axes[:, 0], float(axes[:, 0] @ centroid)).facing(towards)
        return plane, float(np.sqrt(max(variances[0], 0.0)))
