"""Depth images of any size by ray casting (Open3D, Embree), without a renderer."""

import mujoco
import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from pipeline.transforms import from_rotation
from sarsim.ground_truth.meshes import drawn_geoms, joined_mesh
from sarsim.sensors.camera import camera_intrinsics


class DepthRays:
    """A camera's rays, and what they meet: all visible geoms but the robot's, where they stand at the start."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, camera_id: int, size: tuple[int, int]):
        """``size``: width and height of the images, pixels, over the camera's whole field of view."""
        robot = model.body_rootid[model.cam_bodyid[camera_id]]
        geoms = np.flatnonzero(drawn_geoms(model) & (model.body_rootid[model.geom_bodyid] != robot))
        poses = [from_rotation(data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]) for g in geoms]
        mesh, self._scene = joined_mesh(model, geoms, poses), o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(mesh.vertices), o3d.core.Tensor.from_numpy(mesh.triangles)
        )
        k = camera_intrinsics(model, camera_id, *size)
        u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        self._optical = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)

    def depth(self, T_world_camera: NDArray[np.float64]) -> NDArray[np.float32]:
        """(height, width) float32 m along the optical axis, 0 where no surface is met."""
        along = self._optical @ T_world_camera[:3, :3].T
        rays = np.concatenate([np.broadcast_to(T_world_camera[:3, 3], along.shape), along], axis=-1)
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(np.ascontiguousarray(rays, np.float32)), nthreads=1)[
            "t_hit"
        ].numpy()
        return np.where(np.isfinite(hit), hit, 0).astype(np.float32)
