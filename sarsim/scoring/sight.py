"""Computes the true ground that a robot's depth camera would see from given poses, without noise."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pipeline.arrays import Pose, Poses
from pipeline.elevation_map.traversability import Traversability
from pipeline.frame import Frame
from pipeline.transforms import transform_places
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.scoring.coverage import SEEN_HEIGHT


class Sight:
    """Casts one ray from the camera to the centre of each drivable cell in its image (Open3D, Embree).

    Attributes:
        cells: (N, 2) indices of the drivable cells, sorted.
    """

    def __init__(self, surface: GroundTruthSurface, ground: Traversability, scene: Any, frame: Frame):
        """Look at the drivable ground of a surface.

        Args:
            surface: the true ground.
            ground: the ground on the same grid, which gives the tilt of a robot that stands there.
            scene: Open3D's RaycastingScene of all visible surfaces, in the world frame, m.
            frame: any frame of the camera; only its intrinsics, its camera's pose and its sensor's limits are used.
        """
        self._grid, self._ground, self._scene, self._frame = surface.grid, ground, scene, frame
        self.cells = np.argwhere(surface.drivable)
        self._middles = np.column_stack([self._grid.centre_of(self.cells), surface.height[surface.drivable]])

    def views(self, poses: NDArray[np.float64]) -> sparse.csr_array:
        """(V, N) bool, sparse, the cells seen from each of the poses (V, 3): x and y, m, and heading, rad."""
        rows = [self._visible_cells(T @ self._frame.T_base_camera) for T in self._on_ground(poses)]
        ends = np.cumsum([0, *map(len, rows)])
        columns = np.concatenate([*rows, np.zeros(0, np.int64)])
        return sparse.csr_array((np.ones(len(columns), np.bool_), columns, ends), shape=(len(poses), len(self.cells)))

    def _on_ground(self, poses: NDArray[np.float64]) -> Poses:
        """Poses of a robot that stands on the ground and is tilted like the ground."""
        where = tuple(self._grid.cell_of(poses).T)
        slope, ahead = self._ground.gradient[where], np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
        x = np.column_stack([ahead, (slope * ahead).sum(axis=1)])
        z = np.column_stack([-slope, np.ones(len(poses))])
        x, z = (axis / np.linalg.norm(axis, axis=1)[:, None] for axis in (x, z))
        T = np.tile(np.eye(4), (len(poses), 1, 1))
        T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = x, np.cross(z, x), z
        T[:, :2, 3], T[:, 2, 3] = poses[:, :2], self._ground.elevation[where]
        return T

    def _visible_cells(self, T_world_camera: Pose) -> NDArray[np.int64]:
        """Sorted indices of the cells that one image shows."""
        lens, sensor = self._frame.intrinsics, self._frame.sensor
        corners = transform_places(T_world_camera, sensor.farthest * lens.frustum)
        (i0, j0), (i1, j1) = self._grid.cell_of([corners.min(axis=0), corners.max(axis=0)])
        # The cells are sorted, so the cells within the view along x form a slice.
        near = np.arange(*np.searchsorted(self.cells[:, 0], [i0, i1 + 1]))
        near = near[(self.cells[near, 1] >= j0) & (self.cells[near, 1] <= j1)]
        along = self._middles[near] - T_world_camera[:3, 3]
        points = along @ T_world_camera[:3, :3]
        inside = lens.project(points)[1] & (points[:, 2] >= sensor.nearest) & (points[:, 2] <= sensor.farthest)
        near, along = near[inside], along[inside]
        return near[self._hits_ground(T_world_camera[:3, 3], along, near)] if len(near) else near

    def _hits_ground(
        self, origin: NDArray[np.float64], along: NDArray[np.float64], cells: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """(M,) bool, whether rays (M, 3) from a point hit the ground of their cells at an angle that is not grazing.

        ``along``: the rays; ``cells``: (M,) indices into :attr:`cells`. A hit lies less than ``SEEN_HEIGHT`` above or
        below the ground of its cell.
        """
        import open3d as o3d  # not at the top, because it takes a second

        rays = np.hstack([np.broadcast_to(origin, along.shape), along]).astype(np.float32)
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=1)
        t, normal = hit["t_hit"].numpy(), hit["primitive_normals"].numpy()
        points = origin + np.where(np.isfinite(t), t, 0)[:, None] * along
        is_same = (self._grid.cell_of(points) == self.cells[cells]).all(axis=1)
        is_ground = np.abs(points[:, 2] - self._middles[cells, 2]) < SEEN_HEIGHT
        incidence = np.abs((normal * along).sum(axis=1)) / np.linalg.norm(along, axis=1)
        return is_same & is_ground & (incidence >= np.sin(self._frame.sensor.min_grazing_angle))
