"""Depth images of any size from ray casting (Open3D, Embree), without a renderer."""

import mujoco
import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from pipeline.arrays import Pose
from sarsim.ground_truth.meshes import true_scene
from sarsim.sensors.camera import camera_intrinsics


class DepthRays:
    """A camera's rays, and what they can hit: all visible geoms except the robot's, at their initial poses."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, camera_id: int, size: tuple[int, int]):
        """``size``: width and height of the images, pixels, over the camera's whole field of view."""
        self._scene = true_scene(model, data, model.cam_bodyid[camera_id])
        k = camera_intrinsics(model, camera_id, *size)
        u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        self._optical = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)

    def depth(self, T_world_camera: Pose) -> NDArray[np.float32]:
        """(height, width) float32 depths along the optical axis, m; 0 where a ray hits no surface."""
        along = self._optical @ T_world_camera[:3, :3].T
        rays = np.concatenate([np.broadcast_to(T_world_camera[:3, 3], along.shape), along], axis=-1)
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(np.ascontiguousarray(rays, np.float32)), nthreads=1)[
            "t_hit"
        ].numpy()
        return np.where(np.isfinite(hit), hit, 0).astype(np.float32)
