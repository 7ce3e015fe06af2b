"""A robot that tells all that it senses and does, and a bag of what an explorer makes of it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.explorer import Explorer, Step
from pipeline.frame import Frame
from pipeline.mapper import Keyframe
from pipeline.recording.ros.bag import Bag
from pipeline.recording.ros.topics import ImageFormat, Joints, MapTopics, Odometry, RobotTopics
from pipeline.robot import Motion, Robot, Velocity

TICK = 1e-6  # s between frames that were taken at one moment: bags tell them apart by their times


class Listener(Protocol):
    """Takes what a robot senses and does, as :class:`RobotTopics` does."""

    def frame(self, frame: Frame) -> None:
        """What the camera saw."""

    def motion(self, motion: Motion, command: Velocity) -> None:
        """What the body felt, and was told."""

    def joints(self, time: float, joints: Joints) -> None:
        """How the wheels turned at a time in s."""

    def odometry(self, odometry: Odometry) -> None:
        """Where it was."""


class RecordedRobot:
    """Implements :class:`pipeline.robot.Robot` by another one, which it tells of.

    Attributes:
        T_map_odom: gives 4×4, where ``odom`` is now; None while that is not known.
        T_world_base: gives 4×4, where the robot truly is now, if anything knows.
        joints: gives the wheels as they are now, if anything knows.
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
        """Take a frame where the robot stands."""
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
        """Where the robot is, once for each time."""
        if time > self._told:
            self._topics.odometry(Odometry(time, T_odom_base, twist, self.T_map_odom(), self.T_world_base()))
            self._told = time


class ExplorerBag(Bag):
    """A bag of all that a robot senses and does and of the maps that an explorer makes of it.

    Attributes:
        robot: for the explorer to drive.
    """

    def __init__(self, path: Path, images: ImageFormat, robot: Robot):
        """Raises InputError where the bag cannot be written."""
        super().__init__(path)
        self.robot = RecordedRobot(robot, RobotTopics(self.write, images))
        self._maps = MapTopics(self.write)
        self._explorer: Explorer | None = None

    def watch(self, explorer: Explorer) -> None:
        """From now on tell where the explorer's localisation has the robot."""
        self._explorer = explorer
        self.robot.T_map_odom = lambda: explorer.mapper.localisation.T_map_odom if explorer.steps else None

    def add_keyframe(self, keyframe: Keyframe) -> None:
        """Tell of the newest keyframe."""
        self._maps.keyframe(keyframe)

    def add(self, step: Step) -> None:
        """Tell of the newest step."""
        assert self._explorer is not None
        self._maps.maps(self._explorer.mapper, step.keyframe, step.plan)
