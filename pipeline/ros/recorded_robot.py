"""A robot that reports what it senses and does, and a bag of these data and an explorer's maps."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.explorer import Explorer, Step
from pipeline.frame import Frame
from pipeline.mapper import Keyframe
from pipeline.robot import Motion, Robot, Velocity
from pipeline.ros.bag import Bag
from pipeline.ros.topics import ImageFormat, Joints, MapTopics, OdometrySample, RobotTopics

TICK = 1e-6  # s added between frames that were taken at the same time: bags identify them by their times


class Listener(Protocol):
    """Takes what a robot senses and does, as :class:`RobotTopics` does."""

    def frame(self, frame: Frame) -> None:
        """Take a frame of the camera."""

    def motion(self, motion: Motion, command: Velocity) -> None:
        """Take a motion, and the command that the robot followed."""

    def joints(self, time: float, joints: Joints) -> None:
        """Take the wheels' angles and speeds at a time in s."""

    def odometry(self, odometry: OdometrySample) -> None:
        """Take the robot's pose and velocity."""


class RecordedRobot:
    """Implements :class:`pipeline.robot.Robot` by another robot, and reports what that robot senses and does.

    Attributes:
        T_map_odom: returns the present 4×4 pose of ``odom`` in ``map``; None while it is not known.
        T_world_base: returns the present true 4×4 pose of the robot; None if it is not known.
        joints: returns the present state of the wheels; None if it is not known.
    """

    def __init__(self, robot: Robot, topics: Listener):
        """``topics`` takes what the robot senses and does."""
        self.robot, self.model, self.control_period = robot, robot.model, robot.control_period
        self.T_map_odom: Callable[[], NDArray[np.float64] | None] = lambda: None
        self.T_world_base: Callable[[], NDArray[np.float64] | None] = lambda: None
        self.joints: Callable[[], Joints | None] = lambda: None
        self._topics = topics
        self._told = self._seen = -np.inf

    def sense(self) -> Frame:
        """Take a frame at the robot's present pose."""
        frame = self.robot.sense()
        self._seen = max(frame.time, self._seen + TICK)
        frame = replace(frame, time=self._seen)
        self._tell(frame.time, frame.T_odom_base, Velocity())
        self._topics.frame(frame)
        return frame

    def drive(self, command: Velocity) -> Motion:
        """Follow ``command`` for one control period."""
        motion, joints = self.robot.drive(command), self.joints()
        self._topics.motion(motion, command)
        if joints is not None:
            self._topics.joints(motion.time, joints)
        self._tell(motion.time, motion.T_odom_base, motion.twist)
        return motion

    def _tell(self, time: float, T_odom_base: NDArray[np.float64], twist: Velocity) -> None:
        """Report the robot's pose, once for each time."""
        if time > self._told:
            self._topics.odometry(OdometrySample(time, T_odom_base, twist, self.T_map_odom(), self.T_world_base()))
            self._told = time


class ExplorerBag(Bag):
    """A bag of all that a robot senses and does and of the maps that an explorer makes from it.

    Attributes:
        robot: the robot for the explorer to drive.
    """

    def __init__(self, path: Path, images: ImageFormat, robot: Robot):
        """Begin a bag; InputError if it cannot be written."""
        super().__init__(path)
        self.robot = RecordedRobot(robot, RobotTopics(self.write, images))
        self._maps = MapTopics(self.write)
        self._explorer: Explorer | None = None

    def watch(self, explorer: Explorer) -> None:
        """From now on report the robot's pose by the explorer's localisation."""
        self._explorer = explorer
        self.robot.T_map_odom = lambda: explorer.mapper.localisation.T_map_odom if explorer.steps else None

    def add_keyframe(self, keyframe: Keyframe) -> None:
        """Write the newest keyframe."""
        self._maps.keyframe(keyframe)

    def add(self, step: Step) -> None:
        """Write the maps and the plan of the newest step."""
        assert self._explorer is not None
        self._maps.maps(self._explorer.mapper, step.keyframe, step.plan)
