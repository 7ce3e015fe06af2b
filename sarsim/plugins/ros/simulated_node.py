"""The simulated robot as a ROS 2 node, in place of a real robot or one in Gazebo."""

from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from pipeline.datasets.messages import BASE, CAMERA
from pipeline.datasets.recorded_robot import Joints, OdometrySample
from pipeline.errors import InputError, required
from pipeline.files import make_folder
from pipeline.plugins.ros.live.node import RosNode
from pipeline.plugins.ros.messages import command_of, decode, time_of, transform
from pipeline.plugins.ros.topics import RobotTopics
from pipeline.results import write_report
from pipeline.robot import Robot, Velocity
from sarsim.methods.arena import make_arena
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.ros.settings import RosRobotConfig
from sarsim.robots.skid_steered import WHEELS
from sarsim.scoring.coverage import Coverage
from sarsim.scoring.navigation import NavigationScore
from sarsim.scoring.trajectory import write_true_tum
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig, TrueFrame

COMMAND_TOPIC, KEYFRAME_TOPIC = "/cmd_vel", "/keyframe"
MAX_COMMAND_WAIT = 0.1
"""s of wall-clock time, the maximum wait for the next command after each control period."""
WATCHDOG_TIMEOUT = 0.5
"""s of simulated time without a command after which the robot stops."""
MAX_TRUE_FRAMES = 30
"""Number of the newest true frames that are kept until an explorer reports which of them are keyframes."""


class SimulatedNode:
    """A robot in an arena that publishes its sensor data and receives commands over topics.

    Attributes:
        robot: the simulated robot.
        coverage: coverage of the true ground by the frames that an explorer uses as keyframes.
        commands: number of commands received.
    """

    def __init__(self, config: RosRobotConfig, node: RosNode):
        """Place the robot and subscribe to its topics; InputError if the arena or the folder is not available."""
        if not 0 < config.camera_rate <= 25:
            raise InputError(f"--camera-rate {config.camera_rate:g}: must be above 0 and at most 25")
        if config.seed < 0:
            raise InputError(f"--seed {config.seed}: must not be negative")
        self.config, self._node = config, node
        self._plugins = make_plugins(config, ("add_to_arena", "measurements"))
        arena = make_arena(config.arena, config.start, seed=config.seed)
        for plugin in self._plugins:
            plugin.add_to_arena(arena)
        simulation = SimulationConfig(lighting=config.lighting, robot=config.robot, camera_size=config.camera_size)
        self.robot = SimulatedRobot(arena, simulation, config.seed)
        with ExitStack() as refused:
            refused.callback(self.robot.close)
            self._driven: Robot = self.robot
            for plugin in self._plugins:
                refused.callback(plugin.abandon)
                self._driven = plugin.wrap(self._driven, self.robot, None)
            self.coverage = Coverage(self.robot)
            self._navigation = NavigationScore(self.robot, self.coverage.surface)
            if config.out:
                make_folder(config.out)
            refused.pop_all()
        self.commands = 0
        self._topics = RobotTopics(node.publish)
        self._command, self._command_time = Velocity(), -np.inf
        self._start_time, self._start_wall_time = self.robot.time, node.now()
        self._next_frame, self._has_camera = self.robot.time, False
        self._true_frames: deque[tuple[float, TrueFrame]] = deque(maxlen=MAX_TRUE_FRAMES)
        self._keyframes: list[float] = []
        self._command_type = "geometry_msgs/msg/TwistStamped" if config.stamped else "geometry_msgs/msg/Twist"
        node.subscribe(COMMAND_TOPIC, self._obey, self._command_type)
        node.subscribe(
            KEYFRAME_TOPIC, lambda data: self._keyframes.append(time_of(data)), "geometry_msgs/msg/PoseStamped"
        )

    def _obey(self, data: bytes) -> None:
        self._command, self._command_time = command_of(decode(data, self._command_type)), self.robot.time
        self.commands += 1

    def run(self, interrupted: Callable[[], bool], on_period: Callable[[float], object] = lambda time: None) -> None:
        """Simulate until ``interrupted`` returns True, then write the true trajectory and the report.

        ``on_period`` is called after each control period with the simulated time so far, s.
        """
        try:
            while not interrupted():
                start, commands = self._node.now(), self.commands
                self.run_period()
                on_period(self.robot.time - self._start_time)
                if self.config.pace == "real-time":
                    self._node.wait(lambda: False, start + self.robot.control_period - self._node.now())
                elif self.config.pace == "commands":
                    self._node.wait(partial(self._is_commanded_since, commands), MAX_COMMAND_WAIT)
        finally:
            if self.config.out:
                write_report(self.report(), self.config.out)
                write_true_tum(self.config.out / "trajectory_true.tum", self.robot.trajectory)
            self.robot.close()

    def _is_commanded_since(self, commands: int) -> bool:
        return self.commands > commands

    def run_period(self) -> None:
        """Follow the newest command for a control period, and publish the sensors' measurements, odometry last."""
        with self._node.received:
            is_commanded = self.robot.time - self._command_time < WATCHDOG_TIMEOUT
            command = self._command if is_commanded else Velocity()
            keyframes, self._keyframes = self._keyframes, []
        motion, topics = self._driven.drive(command), self._topics
        topics.take_motion(motion)
        for plugin in self._plugins:
            for topic, time, message in plugin.measurements():
                self._node.publish(topic, time, message)
        topics.take_joints(motion.time, Joints(WHEELS, *self.robot.wheels))
        topics.take_odometry(OdometrySample(motion.time, motion.T_odom_base, motion.twist))
        if motion.time >= self._next_frame - 1e-6:
            self._next_frame += 1 / self.config.camera_rate
            self._sense()
        for time in keyframes:
            for seen in [frame for known, frame in self._true_frames if abs(known - time) < 1e-6]:
                self.coverage.see(seen.points())

    def _sense(self) -> None:
        frame = self.robot.sense()
        if not self._has_camera:
            link = transform(frame.time, BASE, CAMERA, frame.T_base_camera)
            self._node.publish("/camera/transform", frame.time, link)
            self._has_camera = True
        self._topics.take_frame(replace(frame, label=None))
        self._true_frames.append((frame.time, required(self.robot.true_frame)))

    def report(self) -> dict[str, Any]:
        """The true figures of the drive, named as in an episode's report.json."""
        sim_time, wall_time = self.robot.time - self._start_time, self._node.now() - self._start_wall_time
        return {
            "arena": self.config.arena,
            "seed": self.config.seed,
            "version": version("sarsim"),
            "sim_time_s": sim_time,
            "wall_time_s": wall_time,
            "real_time_factor": sim_time / wall_time,
            "navigation": self._navigation.report(),
            "exploration": {"explored_fraction": self.coverage.fraction},
        }
