"""The points that frames are registered with: each surface as measured by the first keyframe that saw it."""

import numpy as np
import small_gicp

from pipeline.arrays import Directions, Indices, Mask, Place, Places, Points, Pose, Poses, Values
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.growing import GrowingArray
from pipeline.localisation.registration import Surfaces, Target, front_normals

FOOT_RADIUS = 0.25
"""Radius of the disc under the robot in which ground is searched for, m."""
MIN_GROUND_UPWARD = 0.8
"""Minimum upward component of a ground normal."""


class LocalMap:
    """Points in the frames of the keyframes that own them, so that corrections of a keyframe's pose move its points.

    Attributes:
        points: the points, in the ``base_link`` of their keyframe.
        normals: surface normals, in the same frame, on the side from which the points were seen.
        owner: index of the keyframe that owns each point.
    """

    def __init__(self, config: LocalisationConfig) -> None:
        self._config = config
        self._points = GrowingArray(3)
        self._normals = GrowingArray(3)
        self._owner = GrowingArray(dtype=np.int64)
        self._points_in_map = GrowingArray(3)
        self._normals_in_map = GrowingArray(3)
        self._placed = np.zeros((0, 4, 4))  # the poses with which the points were transformed to ``map``

    @property
    def points(self) -> Places:
        """The points, in the ``base_link`` of their keyframe."""
        return self._points.values

    @property
    def normals(self) -> Directions:
        """The normals at the points, in the same frame."""
        return self._normals.values

    @property
    def owner(self) -> Indices:
        """Index of the keyframe that owns each point."""
        return self._owner.values

    def restore(self, points: Places | Points, normals: Directions, owner: Indices) -> None:
        """Start with the points of an earlier run, which :meth:`apply_poses` then transforms to ``map``."""
        self._points.values = points
        self._normals.values = normals
        self._owner.values = owner
        self._points_in_map.values = self._normals_in_map.values = np.zeros_like(points)
        self._placed = np.zeros((0, 4, 4))

    def add(self, owner: int, T_map_base: Pose, cloud: small_gicp.PointCloud, camera: Place, new: Mask) -> None:
        """Add the points of a keyframe's ``cloud`` that the mask ``new`` selects.

        ``cloud`` and ``camera``, the camera's position, are in ``base_link``.
        """
        points, normals = cloud.points()[new, :3], front_normals(cloud, camera)[new]
        at, facing = _in_map(np.broadcast_to(T_map_base, (len(points), 4, 4)), points, normals)
        self._points_in_map.extend(at)
        self._normals_in_map.extend(facing)
        self._points.extend(points)
        self._normals.extend(normals)
        self._owner.extend(np.full(len(points), owner))

    def apply_poses(self, poses: Poses) -> None:
        """Transform points to ``map`` again, with the corrected ``poses`` of their keyframes, where these moved."""
        has_moved = np.ones(len(poses), np.bool_)
        known = len(self._placed)
        has_moved[:known] = (poses[:known] != self._placed).any(axis=(1, 2))
        self._placed = poses.copy()
        moved = np.flatnonzero(has_moved[self.owner])
        T = poses[self.owner[moved]]
        self._points_in_map.values[moved], self._normals_in_map.values[moved] = _in_map(
            T, self.points[moved], self.normals[moved]
        )

    def around(
        self, points: Places, camera: Place, owners: Mask, margin: float, weight: Values | None = None
    ) -> Target | None:
        """The map's points that face the camera, within ``margin`` m of the box around ``points``; None if too few.

        A wall has two sides, of which one faces the camera. ``owners``: whether each keyframe's points may be used.
        ``weight``: weight of each keyframe's points.
        """
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        at, normals, near = self._points_in_map.values, self._normals_in_map.values, self._within(low, high, owners)
        near = near[np.einsum("ni,ni->n", normals[near], camera - at[near]) > 0]
        is_enough = len(near) >= self._config.registration.min_points
        if not is_enough:
            return None
        owner = self.owner[near]
        return Target(at[near], normals[near], owner, None if weight is None else weight[owner])

    def surfaces(self, place: Place, reach: float, owners: Mask) -> tuple[Surfaces, Indices]:
        """The surfaces in ``map`` within ``reach`` m of a place along x and y, and the keyframe that owns each point.

        ``owners``: whether each keyframe's points may be used.
        """
        margin = np.array([reach, reach, np.inf])
        near = self._within(place - margin, place + margin, owners)
        at, normals = self._points_in_map.values, self._normals_in_map.values
        return Surfaces(at[near], normals[near]), self.owner[near]

    def ground_below(self, T_map_base: Pose, owners: Mask) -> tuple[Values, Indices]:
        """Heights of the ground points right below a robot, m in ``base_link``, and the keyframes that own them.

        ``owners``: whether each keyframe's points may be used.
        """
        at, normals = self._points_in_map.values, self._normals_in_map.values
        near = self._within(T_map_base[:3, 3] - FOOT_RADIUS, T_map_base[:3, 3] + FOOT_RADIUS, owners)
        near = near[normals[near, 2] > MIN_GROUND_UPWARD]
        x, y, z = ((at[near] - T_map_base[:3, 3]) @ T_map_base[:3, :3]).T
        is_below = np.hypot(x, y) < FOOT_RADIUS
        return z[is_below], self.owner[near][is_below]

    def _within(self, low: Place, high: Place, owners: Mask) -> Indices:
        """Indices of the usable points in a box, m.

        The axes are tested in turn, because few points pass the first test.
        """
        at = self._points_in_map.values
        near = np.flatnonzero((at[:, 0] >= low[0]) & (at[:, 0] <= high[0]))
        for axis in (1, 2):
            near = near[(at[near, axis] >= low[axis]) & (at[near, axis] <= high[axis])]
        return near[owners[self.owner[near]]]

    def all_points(self) -> Points:
        """All points, transformed to ``map``."""
        return self._points_in_map.values.astype(np.float32)


def _in_map(T: Poses, points: Places, normals: Directions) -> tuple[Places, Directions]:
    """Points and normals, each transformed by the pose of its keyframe (N, 4, 4)."""
    R = T[:, :3, :3]
    return np.einsum("nij,nj->ni", R, points) + T[:, :3, 3], np.einsum("nij,nj->ni", R, normals)
