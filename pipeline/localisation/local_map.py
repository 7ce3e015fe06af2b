"""The points that frames are registered with: each surface as the first keyframe to see it measured it."""

import numpy as np
import small_gicp
from numpy.typing import NDArray

from pipeline.localisation.registration import LEAST_POINTS, WIDEST, Target, front_normals

FOOT = 0.25, 0.8
"""m, radius of a disc on which the robot stands, and the least upward component of a normal of ground."""


class LocalMap:
    """Points in the frame of the keyframe that owns them, so that they move along when its pose is corrected.

    Attributes:
        points: (N, 3) m.
        normals: (N, 3) of length 1, on the side from which the points were seen.
        owner: (N,) int64 number of each point's keyframe.
    """

    def __init__(self) -> None:
        self.points = np.zeros((0, 3))
        self.normals = np.zeros((0, 3))
        self.owner = np.zeros(0, np.int64)
        self._in_map = self.points, self.normals

    def add(
        self,
        owner: int,
        T_map_base: NDArray[np.float64],
        cloud: small_gicp.PointCloud,
        camera: NDArray[np.float64],
        new: NDArray[np.bool_],
    ) -> None:
        """Add the ``new`` (N,) points of a keyframe at a 4×4 pose, seen from a camera (3,) in ``base_link``."""
        points, normals = cloud.points()[new, :3], front_normals(cloud, camera)[new]
        R, (at, facing) = T_map_base[:3, :3], self._in_map
        self._in_map = np.vstack([at, points @ R.T + T_map_base[:3, 3]]), np.vstack([facing, normals @ R.T])
        self.points, self.normals = np.vstack([self.points, points]), np.vstack([self.normals, normals])
        self.owner = np.append(self.owner, np.full(len(points), owner))

    def place(self, poses: NDArray[np.float64]) -> None:
        """Transform all points to ``map`` by the poses (K, 4, 4) of their keyframes, which have changed."""
        T = poses[self.owner]
        points = np.einsum("nij,nj->ni", T[:, :3, :3], self.points) + T[:, :3, 3]
        self._in_map = points, np.einsum("nij,nj->ni", T[:, :3, :3], self.normals)

    def around(
        self,
        points: NDArray[np.float64],
        camera: NDArray[np.float64],
        owners: NDArray[np.bool_],
        margin: float = WIDEST,
    ) -> Target | None:
        """The map's points near (N, 3) points that face the camera: a wall seen from behind is another surface.

        Args:
            points: m in ``map``.
            camera: (3,) m in ``map``.
            owners: (K,) bool, the keyframes whose points may be taken.
            margin: m around the points.
        """
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        at, normals = self._in_map
        near = np.flatnonzero(owners[self.owner] & ((at >= low) & (at <= high)).all(axis=1))
        near = near[np.einsum("ni,ni->n", normals[near], camera - at[near]) > 0]
        return Target(at[near], self.owner[near]) if len(near) >= LEAST_POINTS else None

    def ground_below(
        self, T_map_base: NDArray[np.float64], owners: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """(N,) heights of the ground right below a robot at a 4×4 pose, m in ``base_link``, and (N,) the owners.

        ``owners``: (K,) bool, the keyframes whose points may be taken.
        """
        (at, normals), (radius, upward) = self._in_map, FOOT
        near = (np.abs(at - T_map_base[:3, 3]) < radius).all(axis=1) & (normals[:, 2] > upward)
        near &= owners[self.owner]
        x, y, z = ((at[near] - T_map_base[:3, 3]) @ T_map_base[:3, :3]).T
        is_below = np.hypot(x, y) < radius
        return z[is_below], self.owner[near][is_below]

    def all_points(self) -> NDArray[np.float32]:
        """(N, 3) float32 all points, m in ``map``."""
        return self._in_map[0].astype(np.float32)
