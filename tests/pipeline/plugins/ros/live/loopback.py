"""A network of two nodes in one thread, and a robot on it whose world is a painted room."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from typing import Any, NamedTuple

from pipeline.datasets.recorded_robot import OdometrySample
from pipeline.frame import Frame
from pipeline.plugins.ros.bag import LATCHED
from pipeline.plugins.ros.live.actions import GoalEnd
from pipeline.plugins.ros.messages import command_of, decode, encode, type_of
from pipeline.plugins.ros.topics import RobotTopics
from pipeline.robot import Velocity
from pipeline.transforms import from_yaw
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.localisation.driving_robot import seen
from tests.pipeline.localisation.painted_room import painted

Change = Callable[[str, float, Any], list[tuple[str, float, Any]]]
"""Takes a topic, a time in s and a message; returns what is sent in its place."""


def unchanged(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    return [(topic, time, message)]


class Goal:
    """A goal of an action, which both ends see; ``fields`` are CDR."""

    def __init__(self, fields: dict[str, bytes]):
        self.fields, self.is_cancelled = fields, False
        self.end: GoalEnd | None = None
        self.why = ""

    def cancel(self) -> None:
        self.is_cancelled = True


class ServedAction(NamedTuple):
    """An action as its clients see it."""

    take: Callable[[Goal], None]

    def send(self, **fields: Any) -> Goal:
        goal = Goal({name: encode(message) for name, message in fields.items()})
        self.take(goal)
        return goal


class Wire:
    """Passes messages between ends on at once.

    Attributes:
        time: the wall's, s.
        change: what is done to messages.
        heard: all that was sent, by topic.
        served: what takes the goals of an action, by its name.
    """

    def __init__(self) -> None:
        self.time = 100.0
        self.change: Change = unchanged
        self.heard: dict[str, list[Any]] = {}
        self.kinds: dict[str, str] = {}
        self.publishers: dict[str, list[str]] = {}
        self.takers: dict[str, list[tuple[str, Callable[[bytes], None]]]] = {}
        self.served: dict[str, Callable[[Goal], None]] = {}

    def carry(self, topic: str, message: Any) -> None:
        self.heard.setdefault(topic, []).append(message)
        for _, take in self.takers.get(topic, []):
            take(encode(message))


class End:
    """Has the interface of a node; while one end waits, ``work`` lets the other one work."""

    def __init__(self, wire: Wire, name: str):
        self.wire, self.name = wire, name
        self.received = nullcontext()
        self.on_idle: Callable[[], None] = lambda: None
        self.work: Callable[[], None] = lambda: None

    def now(self) -> float:
        return self.wire.time

    def advertise(self, topic: str, name: str) -> None:
        self.wire.kinds[topic] = name
        self.wire.publishers.setdefault(topic, []).append(self.name)

    def publish(self, topic: str, time: float, message: Any) -> None:
        for name, _, changed in self.wire.change(topic, time, message):
            if self.name not in self.wire.publishers.get(name, []):
                self.advertise(name, type_of(changed))
            self.wire.carry(name, changed)

    def subscribe(self, topic: str, take: Callable[[bytes], None], name: str | None = None) -> None:
        self.wire.kinds.setdefault(topic, name or "")
        self.wire.takers.setdefault(topic, []).append((self.name, take))
        for message in self.wire.heard.get(topic, [])[-1:] if topic in LATCHED else ():
            take(encode(message))

    def serve(self, name: str, take: Callable[[Goal], None]) -> None:
        self.advertise(f"{name}/_action/status", "action_msgs/msg/GoalStatusArray")
        self.wire.served[name] = take

    def action(self, name: str, kind: str) -> ServedAction:
        return ServedAction(self.wire.served[name])

    def types(self) -> dict[str, list[str]]:
        return {topic: [name] for topic, name in self.wire.kinds.items()}

    def publishers(self, topic: str) -> list[str]:
        return self.wire.publishers.get(topic, [])

    def subscribers(self, topic: str) -> list[str]:
        return [name for name, _ in self.wire.takers.get(topic, [])]

    def wait(self, until: Callable[[], bool], seconds: float) -> bool:
        end = self.wire.time + seconds
        while not until():
            if self.wire.time >= end:
                return False
            self.work()
            self.on_idle()
        return True


class RoomRobot:
    """A robot by topics in a room, with a camera that takes an image every so many control periods.

    Attributes:
        body: the robot itself.
        frames: that were sent, by their time in s.
    """

    def __init__(self, wire: Wire, kind: str = "geometry_msgs/msg/Twist", every: int = 4):
        self.end, self.body, self._every = End(wire, "robot"), KinematicRobot(), every
        self.body.T = from_yaw(1.2, 1.0, 0.0, 0.0)
        self.frames: dict[float, Frame] = {}
        self._kind, self._command, self._periods = kind, Velocity(), 0
        self._topics = RobotTopics(self.end.publish, "32FC1")
        self.end.subscribe("/cmd_vel", self._obey, kind)

    def _obey(self, data: bytes) -> None:
        self._command = command_of(decode(data, self._kind))

    def period(self) -> None:
        """Drive for a control period, which the wall's clock takes as well."""
        self.end.wire.time += self.body.control_period
        motion = self.body.drive(self._command)
        self._topics.take_motion(motion)
        twist = Velocity(self._command.v, float(motion.gyro[2]))
        self._topics.take_odometry(OdometrySample(motion.time, motion.T_odom_base, twist))
        if self._periods % self._every == 0:
            frame = replace(painted(seen(self.body.T, self.body.T), self.body.T), time=motion.time)
            self.frames[motion.time] = frame
            self._topics.take_frame(frame)
        self._periods += 1
