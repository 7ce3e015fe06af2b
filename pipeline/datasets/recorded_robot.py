"""A robot that reports its frames and motions, so that a drive can be recorded."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from pipeline.arrays import Pose, Values
from pipeline.frame import Frame
from pipeline.robot import Motion, Robot, Velocity

PoseGetter = Callable[[], Pose | None]
"""A function that returns a pose, or None while the pose is not known."""
TICK = 1e-6  # s, added between the times of frames taken at the same time, because bags identify frames by time


class OdometrySample(NamedTuple):
    """Pose and velocity of a robot.

    Attributes:
        time: time of the sample, s.
        T_odom_base: pose from the odometry.
        twist: velocity in ``base_link``.
        T_map_odom: pose of ``odom`` in ``map``; None if it is not known.
        T_world_base: true pose; None if it is not known.
    """

    time: float
    T_odom_base: Pose
    twist: Velocity
    T_map_odom: Pose | None = None
    T_world_base: Pose | None = None


class Joints(NamedTuple):
    """State of the wheels: names of the joints, angles in rad and speeds in rad/s."""

    names: tuple[str, ...]
    position: Values
    speed: Values


class Listener(Protocol):
    """Receives the sensor data and motions of a robot."""

    def take_frame(self, frame: Frame) -> None:
        """Receive a frame of the camera."""

    def take_motion(self, motion: Motion, command: Velocity) -> None:
        """Receive a motion, and the command that the robot followed."""

    def take_joints(self, time: float, joints: Joints) -> None:
        """Receive the wheels' angles and speeds, measured at ``time``, s."""

    def take_odometry(self, odometry: OdometrySample) -> None:
        """Receive the robot's pose and velocity."""


class ReportingRobot:
    """A :class:`pipeline.robot.Robot` that wraps another robot, and reports that robot's sensor data and motions."""

    def __init__(
        self,
        robot: Robot,
        listener: Listener,
        T_map_odom: PoseGetter = lambda: None,
        T_world_base: PoseGetter = lambda: None,
        joints: Callable[[], Joints | None] = lambda: None,
    ):
        """Report to ``listener``.

        Args:
            robot: the robot that senses and drives.
            listener: receives the robot's sensor data and motions.
            T_map_odom: returns the current pose of ``odom`` in ``map``.
            T_world_base: returns the robot's current true pose.
            joints: returns the current state of the wheels; None if it is not known.
        """
        self.robot, self.model, self.control_period = robot, robot.model, robot.control_period
        self._listener, self._joints = listener, joints
        self._T_map_odom, self._T_world_base = T_map_odom, T_world_base
        self._reported = self._seen = -np.inf

    def sense(self) -> Frame:
        """Take a frame at the robot's current pose."""
        frame = self.robot.sense()
        self._seen = max(frame.time, self._seen + TICK)
        frame = replace(frame, time=self._seen)
        self._report(frame.time, frame.T_odom_base, Velocity())
        self._listener.take_frame(frame)
        return frame

    def drive(self, command: Velocity) -> Motion:
        """Follow ``command`` for one control period."""
        motion, joints = self.robot.drive(command), self._joints()
        self._listener.take_motion(motion, command)
        if joints is not None:
            self._listener.take_joints(motion.time, joints)
        self._report(motion.time, motion.T_odom_base, motion.twist)
        return motion

    def _report(self, time: float, T_odom_base: Pose, twist: Velocity) -> None:
        """Report the robot's pose and velocity, unless they were already reported for this time."""
        if time > self._reported:
            self._listener.take_odometry(
                OdometrySample(time, T_odom_base, twist, self._T_map_odom(), self._T_world_base())
            )
            self._reported = time
