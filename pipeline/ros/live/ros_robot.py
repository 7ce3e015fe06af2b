"""A robot on a network of ROS 2, real or simulated, as the pipeline's robot."""

import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import SAME_TIME, Frame
from pipeline.robot import Motion, RobotModel, Velocity
from pipeline.ros import messages
from pipeline.ros.live.node import DISCOVERY, RosNode
from pipeline.ros.live.senses import Senses
from pipeline.ros.live.topic_names import TopicNames
from pipeline.ros.pinhole import Pinhole
from pipeline.transforms import angle_of, inverse

_log = logging.getLogger(__name__)
LEAST_COMMAND = np.array([0.04, 0.15])
"""m/s and rad/s; a robot may ignore slower commands."""
LEAST_MOTION = 0.02, np.deg2rad(3)
"""m and rad by which a robot that follows a command moves at least."""
LEAST_PERIOD = 0.04
"""s, least control period."""
HOLD = 0.2
"""s of the robot's time without a new command after which it is stopped: the pipeline is computing. A frame may be
half as much older than the newest odometry."""
STAMPED = "geometry_msgs/msg/TwistStamped"
STARTING = 5
"""Messages of odometry from which its period is estimated."""


class RosRobot:
    """Implements :class:`pipeline.robot.Robot` by topics. Time goes on while the pipeline computes.

    Attributes:
        model: its size and abilities.
        control_period: s.
    """

    def __init__(
        self,
        node: RosNode,
        model: RobotModel,
        topics: TopicNames,
        T_base_camera: NDArray[np.float64] | None = None,
        patience: float = 5.0,
        wait: float = 0.0,
        on_motion: Callable[[Motion], object] = lambda motion: None,
    ):
        """Find the robot.

        Args:
            node: on the robot's network.
            model: its size and abilities.
            topics: their names.
            T_base_camera: 4×4; by default taken from ``/tf_static`` or ``/camera/transform``.
            patience: s by the wall clock that a topic may be silent; in twice as many it must heed commands.
            wait: s by the wall clock, beyond these, that a robot which is not there yet may take to start.
            on_motion: called with every motion; an exception that it raises ends the drive.

        Raises:
            InputError: a necessary topic, listener or transform is missing.
        """
        self.model, self.topics = model, topics
        self._on_motion = on_motion
        self._node, self._patience = node, patience
        self._senses = Senses(model.half_width)
        self._heard: dict[str, float] = {}
        self._last, self._commanded, self._is_driving = Velocity(), -np.inf, False
        self._frame_time = -np.inf
        self._anchor, self._unheeded = np.eye(4), 0.0
        self._find(wait)
        self._camera = Pinhole(Path(topics.camera_info), self._senses.info)
        self._T_base_camera = self._camera_pose() if T_base_camera is None else T_base_camera
        self.control_period = round(max(LEAST_PERIOD, self._senses.period), 4)
        node.idle = self._rest

    def _find(self, wait: float) -> None:
        """Wait up to ``wait`` s longer than patience for all necessary topics, and listen to them."""
        node, topics, senses = self._node, self.topics, self._senses
        needed = (topics.depth, topics.color, topics.camera_info, topics.odom)

        def missing() -> list[str]:
            silent = [f"nothing sends {topic}" for topic in needed if not node.senders(topic)]
            return silent + [f"nothing listens to {topics.cmd_vel}"] * (not node.listeners(topics.cmd_vel))

        if not node.wait(lambda: not missing(), self._patience):
            _log.warning("no robot yet: %s", ", ".join(missing()))
            if not node.wait(lambda: not missing(), wait):
                raise InputError(f"no robot after {self._patience + wait:g} s: {', '.join(missing())}")
        for topic in needed:
            if len(senders := node.senders(topic)) > 1:
                raise InputError(f"{topic}: several nodes send it, {' and '.join(senders)}")
        types = node.types()
        self._kind = STAMPED if STAMPED in types[topics.cmd_vel] else "geometry_msgs/msg/Twist"
        node.offer(topics.cmd_vel, self._kind)
        self._listen(topics.depth, senses.take_depth(types[topics.depth][0]))
        self._listen(topics.color, senses.take_colour(types[topics.color][0]))
        self._listen(topics.camera_info, senses.take_info)
        self._listen(topics.odom, senses.take_odometry)
        places = {"/tf_static": senses.take_transforms, "/camera/transform": senses.take_transform}
        # Optional topics may not be discovered yet.
        node.wait(lambda: bool(node.senders(topics.imu)) and any(map(node.senders, places)), DISCOVERY)
        for topic, take in {topics.imu: senses.take_imu, **places}.items():
            with suppress(InputError):  # the packages of PyPI have no type for /tf_static
                if node.senders(topic):
                    self._listen(topic, take)
        self._wait(lambda: senses.info is not None and senses.poses >= STARTING and self._sees(-np.inf))

    def _listen(self, topic: str, take: Callable[[bytes], None]) -> None:
        def heard(data: bytes) -> None:
            self._heard[topic] = self._node.now()
            take(data)

        self._node.listen(topic, heard)
        self._heard.setdefault(topic, -np.inf)

    def _camera_pose(self) -> NDArray[np.float64]:
        frame = self._senses.camera_frame
        self._node.wait(lambda: self._senses.links.T_base(frame) is not None, self._patience)
        T = self._senses.links.T_base(frame)
        if T is None:
            told = "--camera x y z roll pitch yaw does"
            raise InputError(f"no transform tells where {frame or 'the camera'} is on the robot; {told}")
        return T

    def sense(self) -> Frame:
        """The newest frame, at most half of HOLD older than the newest odometry.

        A robot that drives repeats its last command meanwhile, for HOLD s at most.

        Raises:
            InputError: a topic fell silent, or its images cannot be used.
        """
        senses, start = self._senses, self._senses.time
        after = max(start - HOLD / 2, self._frame_time)
        while self._last != Velocity() and not self._sees(after) and senses.time - start < HOLD:
            self.drive(self._last)
        self._wait(lambda: self._sees(after))
        with self._node.received:
            self._frame_time = senses.newest(after) or after
            return senses.frame(self._frame_time, self._camera, self._T_base_camera)

    def _sees(self, after: float) -> bool:
        with self._node.received:
            return self._senses.newest(after) is not None

    def drive(self, command: Velocity) -> Motion:
        """Send ``command``, and wait until the odometry is a control period further.

        Raises:
            InputError: a topic fell silent, or the robot ignores commands.
        """
        start, self._is_driving = self._senses.time, True
        self._send(command)
        self._wait(lambda: self._senses.time > start + 0.9 * self.control_period)
        with self._node.received:
            motion = self._senses.motion()
        self._is_driving = False
        self._check_heeded(command, motion, motion.time - start)
        self._on_motion(motion)
        return motion

    @property
    def time(self) -> float:
        """Time of the newest odometry, s."""
        return self._senses.time

    def stop(self) -> None:
        """Command the robot to stand."""
        self._is_driving = False
        self._send(Velocity())

    def _send(self, command: Velocity) -> None:
        self._last, self._commanded = command, self._senses.time
        time = max(0.0, self._senses.time)
        message = messages.velocity_stamped(time, command) if self._kind == STAMPED else messages.velocity(command)
        self._node.send(self.topics.cmd_vel, time, message)

    def _rest(self) -> None:
        """Stop a robot that gets no commands because the pipeline computes; the node's ``idle``."""
        if not self._is_driving and self._last != Velocity() and self._senses.time - self._commanded > HOLD:
            self._send(Velocity())

    def _check_heeded(self, command: Velocity, motion: Motion, elapsed: float) -> None:
        moved = inverse(self._anchor) @ motion.T_odom_base
        if np.linalg.norm(moved[:3, 3]) > LEAST_MOTION[0] or angle_of(moved) > LEAST_MOTION[1]:
            self._anchor, self._unheeded = motion.T_odom_base, 0.0
        elif (np.abs([command.v, command.omega]) > LEAST_COMMAND).any():
            self._unheeded += elapsed
        if self._unheeded > 2 * self._patience:
            self.stop()
            told = f"the robot ignores it, for it has not moved for {2 * self._patience:g} s"
            raise InputError(f"{self.topics.cmd_vel}: {told}")

    def _wait(self, until: Callable[[], bool]) -> None:
        """Wait for messages; if they do not come, stop the robot and raise InputError."""
        if self._node.wait(until, self._patience):
            return
        self.stop()
        raise InputError(f"{self._complaint()}; the robot was stopped")

    def _complaint(self) -> str:
        """The reason why waiting for messages failed."""
        senses, last = self._senses, self._node.now() - self._patience
        once = {"/tf_static", "/camera/transform"} | ({self.topics.camera_info} if senses.info else set())
        if silent := [topic for topic, heard in self._heard.items() if heard < last and topic not in once]:
            return f"{', '.join(silent)}: silent for {self._patience:g} s"
        if abs(senses.image_time - senses.time) > self._patience / 2:
            times = f"images are of {senses.image_time:.2f} s, the odometry of {senses.time:.2f} s"
            return f"the robot's clocks differ: {times}"
        told = f"no newer odometry, or no depth image with a colour image {SAME_TIME:g} s near"
        return f"the robot's stamps make no sense: for {self._patience:g} s {told}"
