"""Level ground, partly seen by a robot, on which user-defined methods are tried before a run."""

import numpy as np

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import assess_map
from pipeline.exploration.viewpoint import Context
from pipeline.frame import Frame, Intrinsics
from pipeline.planning.pose_paths import PosePaths
from pipeline.robot import RobotModel
from pipeline.sensor import XTION
from pipeline.transforms import from_rotation, yaw_of

INTRINSICS = Intrinsics(640, 480, 577.0, 577.0, 320.0, 240.0)
"""Intrinsics of an Xtion, 58° × 45°."""
HEIGHT = 0.65
"""Height of the camera above the ground, m."""
SENSED = 100
"""Returns per ground cell: enough that none of the ground is uncertain."""


def level_frame() -> Frame:
    """A frame of level ground seen from a camera pitched down by 20°; the image is black."""
    sin, cos = np.sin(np.deg2rad(20)), np.cos(np.deg2rad(20))
    R = np.array([[0, -sin, cos], [-1, 0, 0], [0, -cos, -sin]])
    down = -(INTRINSICS.rays @ R[2])
    depth = np.divide(HEIGHT, down, out=np.zeros_like(down), where=down > 0)
    depth[depth > XTION.farthest] = 0
    return Frame(
        time=0.0,
        rgb=np.zeros((*depth.shape, 3), np.uint8),
        depth=depth.astype(np.float32),
        intrinsics=INTRINSICS,
        T_base_camera=from_rotation(R, [0, 0, HEIGHT]),
        T_odom_base=np.eye(4),
    )


def level_context(robot: RobotModel) -> Context:
    """What a robot knows in the middle of a square of level ground, outside of which nothing has been seen."""
    half, pose = 4 * robot.length, np.eye(4)
    world = ElevationMap(robot)
    cell = world.grid.cell
    x, y = np.mgrid[-half:half:cell, -half:half:cell]
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]).astype(np.float32)
    world.update(points, hits=np.full(len(points), SENSED, np.uint32))
    paths = PosePaths(assess_map(world), pose[:2, 3], yaw_of(pose))
    return Context(level_frame(), pose, world.measured, paths, pose[None])
