"""A robot that stands before a wall, for tests that need frames without a simulator."""

import numpy as np

from pipeline.frame import Frame, Intrinsics
from pipeline.labels import Label
from pipeline.robot import Motion, Velocity
from pipeline.transforms import from_rotation
from tests.pipeline.robot_model import PIONEER

INTRINSICS = Intrinsics(160, 120, 144.0, 144.0, 80.0, 60.0)

WALL = 2.5
"""m from the robot to the wall."""

HEIGHT, PITCH = 0.6, np.deg2rad(15)
"""m of the camera above the floor, and how far it looks down."""


class StillRobot:
    """Implements :class:`pipeline.robot.Robot`; the floor is at z = 0, and the wall at x = ``WALL`` up to z = 1 m."""

    model = PIONEER
    control_period = 0.04

    def __init__(self):
        self.time = 0.0

    def sense(self) -> Frame:
        sin, cos = np.sin(PITCH), np.cos(PITCH)
        R = np.array([[0, -sin, cos], [-1, 0, 0], [0, -cos, -sin]])
        rays = INTRINSICS.rays.astype(np.float64) @ R.T
        with np.errstate(divide="ignore"):
            floor = np.where(rays[..., 2] < 0, -HEIGHT / rays[..., 2], np.inf)
        wall = WALL / rays[..., 0]
        too_high = HEIGHT + wall * rays[..., 2] > 1.0
        depth = np.where((wall > floor) | ~too_high, np.minimum(floor, wall), 0)
        label = np.select([depth == 0, floor < wall], [Label.UNLABELLED, Label.TERRAIN], Label.WALL)
        rgb = np.repeat(np.uint8(60 * label)[..., None], 3, axis=2)
        return Frame(
            self.time,
            rgb,
            depth.astype(np.float32),
            INTRINSICS,
            from_rotation(R, [0, 0, HEIGHT]),
            np.eye(4),
            label.astype(np.uint8),
            np.zeros_like(label, np.int32),
        )

    def drive(self, command: Velocity) -> Motion:
        self.time += self.control_period
        zero = np.zeros(3)
        return Motion(self.time, np.eye(4), zero, zero, np.zeros(2))
