"""A robot on a ROS 2 network, real or simulated, as the pipeline's robot."""

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from pipeline.arrays import Pose
from pipeline.datasets.cameras import IMAGE_TYPES, INFO_TYPE, info_topic
from pipeline.datasets.links import tf_topics
from pipeline.errors import InputError
from pipeline.frame import SAME_TIME, Frame
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.config import LiveConfig
from pipeline.plugins.ros.live.node import RosNode
from pipeline.plugins.ros.live.senses import SensorReceiver
from pipeline.plugins.ros.live.topic_names import TopicNames
from pipeline.robot import Motion, RobotModel, Velocity
from pipeline.transforms import angle_of, inverse

_log = logging.getLogger(__name__)
ODOMETRY_TYPE, IMU_TYPE = "nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu"
TWIST_TYPE, STAMPED_TYPE = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
TRANSFORM_TOPIC, TRANSFORM_TYPE = "/camera/transform", "geometry_msgs/msg/TransformStamped"
"""Topic of a transform, used where tf2_msgs is not installed, and its type."""


class RosRobot:
    """Implements :class:`pipeline.robot.Robot` over ROS topics. Time passes while the pipeline computes.

    Attributes:
        model: the robot's size and abilities.
        topics: names of the robot's topics.
        control_period: control period, s.
        sensor: range and noise of the camera; None if neither its name nor the settings determine them.
    """

    def __init__(
        self,
        node: RosNode,
        model: RobotModel,
        topics: TopicNames,
        T_base_camera: Pose | None = None,
        patience: float = 5.0,
        wait: float = 0.0,
        on_motion: Callable[[Motion], object] = lambda motion: None,
        *,
        config: LiveConfig = LiveConfig(),
    ):
        """Find the robot.

        Args:
            node: node on the robot's network.
            model: the robot's size and abilities.
            topics: names of the robot's topics.
            T_base_camera: pose of the camera; by default from the robot's transforms.
            patience: maximum wall-clock time that a topic may be silent, s; the robot must follow commands within
                twice this time.
            wait: additional wall-clock time in which a robot that is not yet on the network may start, s.
            on_motion: called with every motion; an exception that it raises ends the run.
            config: settings of robots on a network.

        Raises:
            InputError: a necessary topic, subscriber or transform is missing, or a topic is silent or has the wrong
                type.
        """
        self.model, self.topics = model, topics
        self._on_motion, self._config = on_motion, config
        self._node, self._patience = node, patience
        self._senses = SensorReceiver(model.half_width, config)
        self._heard: dict[str, float] = {}
        self._last_command, self._command_time, self._is_driving = Velocity(), -np.inf, False
        self._frame_time = -np.inf
        self._anchor, self._ignored_for = np.eye(4), 0.0
        self._connect(wait)
        with node.received:
            self._camera, period = self._senses.camera(topics.depth, topics.color), self._senses.odometry_period
        self._T_base_camera = self._camera_pose() if T_base_camera is None else T_base_camera
        self.sensor = self._senses.sensor
        if self.sensor is not None:
            _log.warning("using depths from %g to %g m", self.sensor.nearest, self.sensor.farthest)
        if self._camera.note:
            _log.warning("%s", self._camera.note)
        self.control_period = round(max(config.min_period, period), 4)
        node.on_idle = self._on_idle

    def _connect(self, wait: float) -> None:
        """Wait for all necessary topics, up to ``wait`` s longer than ``patience``, and subscribe to them."""
        node, topics, senses = self._node, self.topics, self._senses
        needed = (topics.depth, topics.color, topics.camera_info, topics.odom)

        def missing() -> list[str]:
            silent = [f"nothing publishes {topic}" for topic in needed if not node.publishers(topic)]
            return silent + self._missing_receivers()

        if not node.wait(lambda: not missing(), self._patience):
            _log.warning("waiting for the robot: %s", ", ".join(missing()))
            if not node.wait(lambda: not missing(), wait):
                others = "" if all(map(node.publishers, needed)) else self._alternatives(needed)
                raise InputError(f"no robot found within {self._patience + wait:g} s: {', '.join(missing())}{others}")
        for topic in needed:
            if len(publishers := node.publishers(topic)) > 1:
                raise InputError(f"{topic}: several nodes publish it ({', '.join(publishers)}); stop all but one")
        self._prepare_commands()
        depth, colour = self._type_of(topics.depth, *IMAGE_TYPES), self._type_of(topics.color, *IMAGE_TYPES)
        self._subscribe(topics.depth, senses.take_depth(depth), depth)
        self._subscribe(topics.color, senses.take_colour(colour), colour)
        self._subscribe(topics.camera_info, senses.take_info, self._type_of(topics.camera_info, INFO_TYPE))
        self._subscribe(topics.odom, senses.take_odometry, self._type_of(topics.odom, ODOMETRY_TYPE))
        self._subscribe_to_others()
        self._wait(
            lambda: (
                senses.info is not None and senses.pose_count >= self._config.starting and self._has_frame(-np.inf)
            )
        )

    def _type_of(self, topic: str, *expected: str) -> str:
        """The type of a topic's messages, the first of the ``expected`` types; InputError if it has none of them."""
        kinds = self._node.types()[topic]
        if not (usable := [kind for kind in expected if kind in kinds]):
            rule = f"must have the type {' or '.join(expected)}, not {' and '.join(kinds)}"
            raise InputError(f"{topic}: {rule}; choose another topic with the --topics flags")
        return usable[0]

    def _missing_receivers(self) -> list[str]:
        """One text for each missing receiver of the robot's commands."""
        return [] if self._node.subscribers(self.topics.cmd_vel) else [f"nothing subscribes to {self.topics.cmd_vel}"]

    def _prepare_commands(self) -> None:
        self._kind = self._type_of(self.topics.cmd_vel, STAMPED_TYPE, TWIST_TYPE)
        self._node.advertise(self.topics.cmd_vel, self._kind)

    def _subscribe_to_others(self) -> None:
        """Subscribe to topics that not every robot has: IMU, transforms and camera_info of the colour images."""
        node, topics, senses = self._node, self.topics, self._senses

        def transform_topics() -> list[str]:
            sent = {topic: names[0] for topic, names in node.types().items() if node.publishers(topic)}
            return tf_topics(sent, (topics.depth, topics.odom)) + [TRANSFORM_TOPIC] * (
                sent.get(TRANSFORM_TOPIC) == TRANSFORM_TYPE
            )

        # These topics may not be discovered yet.
        node.wait(
            lambda: bool(node.publishers(topics.imu)) and bool(transform_topics()), self._config.discovery_timeout
        )
        takers = {
            name: senses.take_transform if name == TRANSFORM_TOPIC else senses.take_transforms
            for name in transform_topics()
        }
        of_colour = info_topic(topics.color, {topic: names[0] for topic, names in node.types().items()})
        if of_colour not in (None, topics.camera_info):
            takers[of_colour] = senses.take_colour_info
        self._may_fall_silent = set(takers)
        if node.publishers(topics.imu):
            self._type_of(topics.imu, IMU_TYPE)
        elif imus := self._published(IMU_TYPE):
            _log.warning("nothing publishes %s; to use %s instead, set --topics.imu", topics.imu, " or ".join(imus))
        for topic, take in {topics.imu: senses.take_imu, **takers}.items():
            with suppress(InputError):  # the packages of PyPI have no type for transforms
                if node.publishers(topic):
                    self._subscribe(topic, take)
        node.wait(lambda: of_colour not in takers or senses.knows_cameras, self._config.discovery_timeout)

    def _alternatives(self, needed: Sequence[str]) -> str:
        """The published topics that a user may have meant instead of ``needed``, as part of an error message."""
        there = [topic for topic in self._published(*IMAGE_TYPES, INFO_TYPE, ODOMETRY_TYPE) if topic not in needed]
        return f"; published instead: {', '.join(there)}; choose with the --topics flags" if there else ""

    def _published(self, *kinds: str) -> list[str]:
        """The topics on which messages of given types are published."""
        return sorted(
            topic for topic, names in self._node.types().items() if names[0] in kinds and self._node.publishers(topic)
        )

    def _subscribe(self, topic: str, take: Callable[[bytes], None], kind: str | None = None) -> None:
        def receive(data: bytes) -> None:
            self._heard[topic] = self._node.now()
            take(data)

        self._node.subscribe(topic, receive, kind)
        self._heard.setdefault(topic, -np.inf)

    def _camera_pose(self) -> Pose:
        frame_tree, frame = self._senses.frame_tree, self._camera.frame
        self._node.wait(lambda: frame_tree.mount(frame).T_base_camera is not None, self._patience)
        with self._node.received:
            T, self._senses.T_driven_base, note = frame_tree.mount(frame)
        if T is None:
            raise InputError(f"{note}; give the camera's pose with --camera-pose X Y Z ROLL PITCH YAW, m and °")
        if note:
            _log.warning("%s", note)
        return T

    def sense(self) -> Frame:
        """The newest frame, at most half of ``command_timeout`` older than the odometry at the time of the call.

        Until the frame arrives, the last command of a moving robot is repeated, for at most ``command_timeout``.

        Raises:
            InputError: a topic fell silent, or the images cannot be used.
        """
        senses, start, timeout = self._senses, self._senses.time, self._config.command_timeout
        after = max(start - timeout / 2, self._frame_time)
        while self._last_command != Velocity() and not self._has_frame(after) and senses.time - start < timeout:
            self.drive(self._last_command)
        self._wait(lambda: self._has_frame(after))
        with self._node.received:
            self._frame_time = senses.newest_frame_time(after) or after
            return senses.frame(self._frame_time, self._camera, self._T_base_camera)

    def _has_frame(self, after: float) -> bool:
        with self._node.received:
            return self._senses.newest_frame_time(after) is not None

    def drive(self, command: Velocity) -> Motion:
        """Send ``command``, and wait until the odometry has advanced by a control period.

        Raises:
            InputError: a topic fell silent, or the robot ignores commands.
        """
        start, self._is_driving = self._senses.time, True
        self._send(command)
        self._wait(lambda: self._senses.time > start + 0.9 * self.control_period)
        with self._node.received:
            motion = self._senses.motion()
        self._is_driving = False
        self._check_obeyed(command, motion, motion.time - start)
        self._on_motion(motion)
        return motion

    @property
    def time(self) -> float:
        """Time of the newest odometry, s."""
        return self._senses.time

    @property
    def has_map(self) -> bool:
        """Whether any node publishes the pose of the robot's ``odom`` in a map."""
        with self._node.received:
            return self._senses.frame_tree.has_parent(self._senses.odom_frame)

    def stop(self) -> None:
        """Command the robot to stop."""
        self._is_driving = False
        self._send(Velocity())

    def _send(self, command: Velocity) -> None:
        self._last_command, self._command_time = command, self._senses.time
        time = max(0.0, self._senses.time)
        message = (
            messages.velocity_stamped(time, command) if self._kind == STAMPED_TYPE else messages.velocity(command)
        )
        self._node.publish(self.topics.cmd_vel, time, message)

    def _on_idle(self) -> None:
        """Stop a robot that gets no commands because the pipeline is computing; called as the node's ``on_idle``."""
        silence = self._senses.time - self._command_time
        if not self._is_driving and self._last_command != Velocity() and silence > self._config.command_timeout:
            self._send(Velocity())

    def _check_obeyed(self, command: Velocity, motion: Motion, elapsed: float) -> None:
        moved, config = inverse(self._anchor) @ motion.T_odom_base, self._config
        if np.linalg.norm(moved[:3, 3]) > config.min_distance or angle_of(moved) > config.min_turn:
            self._anchor, self._ignored_for = motion.T_odom_base, 0.0
        elif abs(command.v) > config.min_speed or abs(command.omega) > config.min_turn_rate:
            self._ignored_for += elapsed
        if self._ignored_for > 2 * self._patience:
            self.stop()
            why = f"the robot has not moved for {2 * self._patience:g} s despite commands"
            raise InputError(f"{self.topics.cmd_vel}: {why}; check that its motors are enabled")

    def _wait(self, until: Callable[[], bool]) -> None:
        """Wait until messages fulfil a condition.

        Raises:
            InputError: this takes too long, or a message cannot be read; the robot was stopped.
        """
        try:
            if not self._node.wait(until, self._patience):
                raise InputError(f"{self._complaint()}; the robot was stopped")
        except Exception:
            self.stop()
            raise

    def _complaint(self) -> str:
        """The reason why waiting for messages failed."""
        senses, last = self._senses, self._node.now() - self._patience
        once = self._may_fall_silent | ({self.topics.camera_info} if senses.info else set())
        if silent := [topic for topic, heard in self._heard.items() if heard < last and topic not in once]:
            return f"{', '.join(silent)}: no messages for {self._patience:g} s"
        if abs(senses.image_time - senses.time) > self._patience / 2:
            times = f"images at {senses.image_time:.2f} s, odometry at {senses.time:.2f} s"
            return f"the newest timestamps differ by over {self._patience / 2:g} s: {times}; check the clocks"
        missing = f"no newer odometry, or no depth image within {SAME_TIME:g} s of a colour image"
        return f"check the robot's timestamps: for {self._patience:g} s there was {missing}"
