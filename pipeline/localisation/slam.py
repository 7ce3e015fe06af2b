"""Simultaneous localisation and mapping: where the robot is, by its frames, its odometry and gravity."""

from dataclasses import dataclass

import numpy as np
import small_gicp
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.localisation.pose_graph import GRAVITY, PoseGraph
from pipeline.localisation.registration import Prior, Registration, cloud_of, register, shares, front
from pipeline.transforms import inverse, transform_points

RANGE = 3.3
"""m of depth; beyond, the sensor's limit cuts off the far half of its noise."""
MARGIN = 0.3
"""m around a frame's points in which points of the map may correspond to them."""
STRIDE = 2
SR0, SR1 = 0.001, 0.005


@dataclass(eq=False)
class _Seen:
    frame: Frame
    cloud: small_gicp.PointCloud
    T_map_base: NDArray[np.float64]
    registration: Registration | None = None
    target: tuple | None = None


class Slam:
    def __init__(self) -> None:
        self.graph = PoseGraph()
        self.T_map_odom = np.eye(4)
        self._odometry: list[NDArray[np.float64]] = []
        self._points = np.zeros((0, 3), np.float32)
        self._owner = np.zeros(0, np.int64)
        self._normals = np.zeros((0, 3), np.float32)
        self._seen: _Seen | None = None
        self.log = []

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        depth = np.where(frame.depth <= RANGE, frame.depth, 0)[::STRIDE, ::STRIDE]
        returns = depth > 0
        points = frame.intrinsics.rays[::STRIDE, ::STRIDE][returns] * depth[returns, None]
        points = transform_points(frame.T_base_camera, points)
        cloud = cloud_of(points) if len(points) > 100 else None
        self._seen = self._match(frame, cloud)
        self.T_map_odom = self._seen.T_map_base @ inverse(frame.T_odom_base)
        return self._seen.T_map_base

    def _match(self, frame, cloud):
        if not self.graph.poses:
            return _Seen(frame, cloud, frame.T_odom_base)
        prior = self._odometry_prior(frame)
        T = prior.T
        if cloud is None:
            return _Seen(frame, cloud, T)
        points = cloud.points()[:, :3] @ T[:3, :3].T + T[:3, 3]
        low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
        inside = ((self._map_points >= low) & (self._map_points <= high)).all(axis=1)
        camera = (T @ frame.T_base_camera)[:3, 3]
        faces = np.einsum("ni,ni->n", self._map_normals, camera - self._map_points) > 0
        near = np.flatnonzero(inside & faces)
        if len(near) < 100:
            return _Seen(frame, cloud, T)
        target = small_gicp.PointCloud(self._map_points[near])
        tree = small_gicp.KdTree(target)
        small_gicp.estimate_covariances(target, tree, num_neighbors=20)
        registration = register(target, tree, cloud, [prior, self._gravity_prior(frame, T)])
        return _Seen(frame, cloud, registration.T, registration, (target, tree, self._owner[near]))

    def _odometry_prior(self, frame: Frame) -> Prior:
        delta = inverse(self._odometry[-1]) @ frame.T_odom_base
        way = float(np.linalg.norm(delta[:3, 3]))
        turn = float(np.arccos(np.clip((np.trace(delta[:3, :3]) - 1) / 2, -1, 1)))
        sr, st = SR0 + SR1 * turn, 0.005 + 0.03 * way + 0.01 * turn
        sigma = np.array([sr, sr, sr, st, st, st])
        return Prior(self.graph.poses[-1] @ delta, np.diag(sigma**-2.0))

    def _gravity_prior(self, frame, T):
        up, believed = frame.T_odom_base[2, :3], T[2, :3]
        # rotate T on the right so that its up becomes what the odometry says
        axis = np.cross(up, believed)
        from pipeline.localisation.registration import exponential
        mean = T @ exponential(np.r_[axis, 0, 0, 0])
        info = np.zeros((6, 6))
        info[:3, :3] = (np.eye(3) - np.outer(up, up)) / GRAVITY**2
        return Prior(mean, info)

    def add(self, frame: Frame, T_map_base: NDArray[np.float64]) -> None:
        seen = self._seen
        prior = self._odometry_prior(frame) if self.graph.poses else None
        j = self.graph.add(T_map_base, frame.T_odom_base[2, :3])
        points = seen.cloud.points()[:, :3] if seen.cloud else np.zeros((0, 3))
        new = np.ones(len(points), bool)
        if j:
            self.graph.connect(j - 1, j, inverse(self.graph.poses[j - 1]) @ prior.T, prior.information)
        if j and seen.target is not None:
            target, tree, owner = seen.target
            edges, new = shares(target, tree, seen.cloud, T_map_base, owner)
            for i, (H, b) in edges.items():
                delta = -np.linalg.solve(H + 1.0 * np.eye(6), b)
                from pipeline.localisation.registration import exponential
                self.graph.connect(i, j, inverse(self.graph.poses[i]) @ T_map_base @ exponential(delta), H)
            self.log.append((seen.registration.overlap, seen.registration.chi2, len(edges), new.sum()))
        self._odometry.append(frame.T_odom_base)
        self._points = np.concatenate([self._points, points[new].astype(np.float32)])
        normals = front(seen.cloud, frame.T_base_camera[:3, 3]) if seen.cloud else np.zeros((0, 3))
        self._normals = np.concatenate([self._normals, normals[new].astype(np.float32)])
        self._owner = np.concatenate([self._owner, np.full(new.sum(), j)])
        self._place_points()

    def _place_points(self):
        T = np.array(self.graph.poses)[self._owner]
        self._map_normals = np.einsum('nij,nj->ni', T[:, :3, :3], self._normals)
        self._map_points = np.einsum('nij,nj->ni', T[:, :3, :3], self._points) + T[:, :3, 3]

    def optimise(self):
        before = self.graph.poses[-1]
        moved = self.graph.optimise()
        self.T_map_odom = self.graph.poses[-1] @ inverse(self._odometry[-1])
        self._place_points()
        return moved

    @property
    def poses(self):
        return np.array(self.graph.poses)
