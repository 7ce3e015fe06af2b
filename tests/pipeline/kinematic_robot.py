"""A body without a world: it moves exactly as commanded, over a given height, and can be blocked."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.frame import Frame
from pipeline.robot import Motion, Velocity
from pipeline.transforms import from_rotation, from_yaw, yaw_of
from tests.pipeline.robot_model import PIONEER


class KinematicRobot:
    """Implements :class:`pipeline.robot.Robot` except for the camera.

    Attributes:
        T: true pose.
        commands: all commands that it received.
    """

    model = PIONEER
    control_period = 0.05

    def __init__(
        self,
        pitch: Callable[[float, float], float] = lambda x, y: 0.0,
        blocked: Callable[[float], bool] = lambda time: False,
    ):
        """``pitch`` of the ground in rad at (x, y); ``blocked`` at a time in s."""
        self.T = from_yaw(0, 0, 0, 0)
        self.commands: list[Velocity] = []
        self._pitch, self._blocked = pitch, blocked
        self._time = 0.0

    def sense(self) -> Frame:
        raise NotImplementedError("it has no eyes")

    def drive(self, command: Velocity) -> Motion:
        self.commands.append(command)
        self._time += self.control_period
        x, y = self.T[:2, 3]
        yaw = yaw_of(self.T)
        if not self._blocked(self._time):
            yaw += command.omega * self.control_period
            x += command.v * np.cos(yaw) * self.control_period
            y += command.v * np.sin(yaw) * self.control_period
        pitch = self._pitch(x, y)
        tilt = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
        before = self.T[:3, :3]
        self.T = from_rotation(from_yaw(0, 0, 0, yaw)[:3, :3] @ tilt, [x, y, 0])
        gyro = Rotation.from_matrix(before.T @ self.T[:3, :3]).as_rotvec() / self.control_period
        accelerometer = self.T[:3, :3].T @ [0, 0, 9.81]
        return Motion(self._time, self.T.copy(), gyro, accelerometer, np.array([command.v, command.v]))
