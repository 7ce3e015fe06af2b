"""A room of boxes, seen by a camera that is ray-cast with numpy."""

import numpy as np

from pipeline.frame import Intrinsics
from pipeline.transforms import from_rotation

CAMERA = Intrinsics(width=160, height=120, fx=144.3, fy=144.9, cx=80.0, cy=60.0)

BOXES = np.array(
    [
        ((-2.2, -1.7, -0.2), (2.2, 1.7, 0.01)),  # floor
        ((-2.2, -1.7, 0), (-2.03, 1.7, 1.2)),  # walls
        ((2.03, -1.7, 0), (2.2, 1.7, 1.2)),
        ((-2.2, -1.7, 0), (2.2, -1.53, 1.2)),
        ((-2.2, 1.53, 0), (2.2, 1.7, 1.2)),
        ((-0.4, -1.7, 0), (-0.36, 0.4, 1.2)),
        ((0.6, -0.3, 0), (1.23, 0.41, 0.31)),  # a block
    ]
)


def depth_image(T_map_camera, camera=CAMERA):
    """(H, W) float32 noise-free depth in m, 0 = no return."""
    directions = camera.rays.reshape(-1, 3).astype(np.float64) @ T_map_camera[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        faces = (BOXES[:, :, None] - T_map_camera[:3, 3]) / directions
    enter, leave = faces.min(axis=1).max(axis=2), faces.max(axis=1).min(axis=2)
    depth = np.where((enter < leave) & (enter > 0), enter, np.inf).min(axis=0)
    return np.where(np.isfinite(depth), depth, 0).reshape(camera.height, camera.width).astype(np.float32)


def looking(x, y, z, yaw, pitch):
    """4×4 pose of a camera at (x, y, z) m that looks along ``yaw`` and ``pitch`` rad (positive: down)."""
    forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0])
    return from_rotation(np.stack([right, np.cross(forward, right), forward], axis=1), (x, y, z))


def tour(count):
    """Poses through the room, well away from its boxes."""
    places = [(-1.4, -0.9), (-1.4, 0.9), (0.1, 1.0), (0.1, -0.9), (1.6, -0.9), (1.6, 1.0)]
    return [looking(*places[n % 6], 0.55 + 0.01 * n, 2.4 * n, 0.25) for n in range(count)]


def returns(depth, T_map_camera, camera=CAMERA):
    """(N, 3) float64 points of a depth image, m in ``map``."""
    points = (camera.rays * depth[..., None])[depth > 0].astype(np.float64)
    return points @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
