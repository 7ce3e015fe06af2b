"""Looks at scenes of convex polygons, in plain numpy."""

from dataclasses import dataclass

import numpy as np

from pipeline.frame import Frame, Intrinsics
from pipeline.labels import Label

CAMERA = Intrinsics(width=640, height=480, fx=577.0, fy=577.0, cx=320.0, cy=240.0)
HALF = Intrinsics(width=320, height=240, fx=288.5, fy=288.5, cx=160.0, cy=120.0)
RANGE = (0.5, 3.5)


@dataclass(frozen=True)
class Face:
    """A convex polygon: label and (K, 3) corners."""

    label: Label
    corners: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        normal = np.cross(self.corners[1] - self.corners[0], self.corners[2] - self.corners[0])
        return normal / np.linalg.norm(normal)


def floor(x0, x1, y0, y1, z=0.0, label=Label.TERRAIN):
    return Face(label, np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)], float))


def wall(a, b, z0=0.0, z1=1.2):
    """An upright rectangle between the points a and b of the ground."""
    (ax, ay), (bx, by) = a, b
    return Face(Label.WALL, np.array([(ax, ay, z0), (bx, by, z0), (bx, by, z1), (ax, ay, z1)], float))


def wedge(x, y, length, width, height):
    """Slope, two sides and back of an inclined ramp that rises along x from (x, y ± width/2)."""
    a, b = np.array([x, y - width / 2, 0]), np.array([x, y + width / 2, 0])
    along = np.array([length, 0, 0])
    c, d = a + along, b + along
    up = np.array([0, 0, height])
    polygons = [(a, c + up, d + up, b), (a, c, c + up), (b, d, d + up), (c, d, d + up, c + up)]
    return [Face(Label.INCLINED_RAMP, np.array(p, float)) for p in polygons]


def pose(x, y, z, yaw, down=0.0):
    """A camera at (x, y, z) that looks along ``yaw``, tilted ``down`` rad."""
    forward = np.array([np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0])
    T = np.eye(4)
    T[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T[:3, 3] = x, y, z
    return T


def look(faces, T_map_camera, sigma=0.0, seed=0, reach=RANGE, camera=CAMERA):
    """The frame that a camera sees, with depth noise of ``sigma`` m; ``instance`` is the face's index."""
    x, y = camera.rays[0, :, 0].astype(float), camera.rays[:, 0, 1, None].astype(float)
    nearness = np.zeros((camera.height, camera.width))
    face_of_ray = np.full(nearness.shape, -1, np.int32)
    for index, face in enumerate(faces):
        corners = (face.corners - T_map_camera[:3, 3]) @ T_map_camera[:3, :3]
        n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        if corners[0] @ n:
            plane = n / (corners[0] @ n)  # whose scalar product with a ray is 1 / depth
            hit = (near := plane[0] * x + (plane[1] * y + plane[2])) > nearness
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                inwards = np.cross(n, b - a)
                inwards -= plane * (a @ inwards)
                hit &= inwards[0] * x >= -(inwards[1] * y + inwards[2])
            nearness[hit], face_of_ray[hit] = near[hit], index
    depth = np.divide(1, nearness, out=np.full_like(nearness, np.inf), where=nearness > 0)
    depth += np.random.default_rng(seed).normal(0, sigma, depth.shape) if sigma else 0
    depth[~((depth >= reach[0]) & (depth <= reach[1]))] = 0
    return Frame(
        time=0.0,
        rgb=np.zeros((*depth.shape, 3), np.uint8),
        depth=depth.astype(np.float32),
        intrinsics=camera,
        T_base_camera=np.eye(4),
        T_odom_base=T_map_camera,
        label=np.array([face.label for face in faces] + [Label.UNLABELLED], np.uint8)[face_of_ray],
        instance=face_of_ray,
    )
