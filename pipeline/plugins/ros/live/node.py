"""A ROS 2 node (rclpy) that exchanges messages as bytes, because CDR is the same on a network and in a bag."""

import os
import re
from collections.abc import Callable
from contextlib import ExitStack
from importlib import import_module
from threading import Condition, Event, Thread
from time import monotonic
from typing import Any
from warnings import filterwarnings

from pipeline.datasets.messages import Message
from pipeline.errors import InputError, one_line
from pipeline.plugins.ros.bag import LATCHED
from pipeline.plugins.ros.config import LiveConfig
from pipeline.plugins.ros.live.actions import Action
from pipeline.plugins.ros.live.interfaces import interface
from pipeline.plugins.ros.messages import encode, type_of


class RosNode:
    """Publishes and receives messages until it is closed; it listens in a separate thread.

    Attributes:
        on_idle: function that is called repeatedly in the listening thread.
        now: function that returns the time on a monotonic clock, s.
        received: condition that is held while a message is handled and notified afterwards.
    """

    def __init__(self, name: str, network: bool = False, *, config: LiveConfig = LiveConfig()):
        """Join the network under a name.

        Args:
            name: the node's name.
            network: whether other machines may discover it; otherwise, discovery is limited to this machine.
            config: times and queue lengths.

        Raises:
            InputError: the name is invalid, rclpy is not installed, or the network already has a node of this name.
        """
        if not re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name):
            raise InputError(f"--name {name!r}: must consist of letters, digits and _, and not start with a digit")
        if not network:
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        rclpy = _rclpy()
        self.on_idle: Callable[[], None] = lambda: None
        self.now, self._config = monotonic, config
        self._publishers: dict[str, Any] = {}
        self.received, self._closing = Condition(), Event()
        self._failure: Exception | None = None  # of the listening thread, for the thread that waits
        context = rclpy.Context()
        context.init(args=[])
        with ExitStack() as stack:
            stack.callback(context.try_shutdown)
            self._node = rclpy.create_node(name, context=context)
            stack.callback(self._node.destroy_node)
            self._clients = stack.enter_context(ExitStack())  # of actions, which would keep the node alive
            self._executor = import_module("rclpy.executors").SingleThreadedExecutor(context=context)
            self._executor.add_node(self._node)
            thread = Thread(target=self._listen, daemon=True)
            thread.start()
            stack.callback(thread.join)
            stack.callback(self._closing.set)
            if self.wait(lambda: self._node.get_node_names().count(name) > 1, config.discovery_timeout):
                raise InputError(f"a node named {name!r} is already on the network; choose another --name")
            self._stack = stack.pop_all()

    def _listen(self) -> None:
        while not self._closing.is_set():
            try:
                self._executor.spin_once(timeout_sec=self._config.idle)
                self.on_idle()
            except Exception as error:
                # This thread stops a robot that gets no commands, so it must go on.
                self._failure = error
                self._closing.wait(self._config.idle)

    def close(self) -> None:
        """Leave the network, after waiting briefly until sent messages are acknowledged."""
        timeout = import_module("rclpy.duration").Duration(seconds=self._config.discovery_timeout)
        for publisher in self._publishers.values():
            if publisher is not None:
                publisher.wait_for_all_acked(timeout)
        self._stack.close()

    def publish(self, topic: str, time: float, message: Message) -> None:
        """Publish a message, unless its type is not installed; ``time`` is not used."""
        if topic not in self._publishers:
            self.advertise(topic, type_of(message))
        if self._publishers[topic] is not None:
            self._publishers[topic].publish(encode(message))

    def advertise(self, topic: str, name: str) -> None:
        """Announce a topic of messages of the type ``package/msg/Name``, so that subscribers can connect.

        Messages are published reliably, because parts of images get lost with best effort, even on one machine. Every
        subscriber can receive reliable messages.
        """
        qos, kind = import_module("rclpy.qos"), interface(name)
        durability = qos.DurabilityPolicy.TRANSIENT_LOCAL if topic in LATCHED else qos.DurabilityPolicy.VOLATILE
        profile = qos.QoSProfile(depth=1 if topic in LATCHED else self._config.queue, durability=durability)
        self._publishers[topic] = kind and self._node.create_publisher(kind, topic, profile)

    def subscribe(self, topic: str, take: Callable[[bytes], None], name: str | None = None) -> None:
        """Subscribe to a topic.

        Args:
            topic: name of the topic; if no type is given, a node must already publish it.
            take: called in the listening thread with the CDR of each message; must return quickly.
            name: name of the type, ``package/msg/Name``.

        Raises:
            InputError: the type is not installed.
        """
        qos, name = import_module("rclpy.qos"), name or self.types()[topic][0]
        kind = interface(name)
        if kind is None:
            package = name.partition("/")[0]
            raise InputError(f"{topic}: message type {name} is not installed; install the ROS package {package}")
        is_published = bool(self.publishers(topic))
        profile = qos.QoSProfile(
            depth=self._config.odometry_queue,
            reliability=qos.ReliabilityPolicy.BEST_AVAILABLE if is_published else qos.ReliabilityPolicy.BEST_EFFORT,
            durability=qos.DurabilityPolicy.BEST_AVAILABLE if is_published else qos.DurabilityPolicy.VOLATILE,
        )

        def receive(data: bytes) -> None:
            with self.received:
                try:
                    take(data)
                except Exception as error:
                    raise InputError(f"{topic}: a message is not a valid {name}: {one_line(error)}") from error
                self.received.notify_all()

        self._node.create_subscription(kind, topic, receive, profile, raw=True)

    def action(self, name: str, kind: str) -> Action:
        """An action that another node serves; InputError if its type, ``package/action/Name``, is not installed."""
        found = interface(kind)
        if found is None:
            package = kind.partition("/")[0]
            raise InputError(f"{name}: action type {kind} is not installed; install the ROS package {package}")
        client = import_module("rclpy.action").ActionClient(self._node, found, name)
        self._clients.callback(client.destroy)
        return Action(client, found)

    def wait(self, until: Callable[[], bool], seconds: float) -> bool:
        """Wait until a condition holds; False if it does not hold within ``seconds``.

        The condition is checked after every message.

        Raises:
            InputError: a message could not be read. Any other error of the listening thread is raised as well.
        """
        end = self.now() + seconds
        with self.received:
            while not until():
                failure, self._failure = self._failure, None
                if failure is not None:
                    raise failure
                left = end - self.now()
                if left <= 0:
                    return False
                self.received.wait(min(left, self._config.idle))
        return True

    def types(self) -> dict[str, list[str]]:
        """Types of the messages that are published or subscribed to, by topic."""
        return dict(self._node.get_topic_names_and_types())

    def publishers(self, topic: str) -> list[str]:
        """Names of the nodes that publish a topic."""
        return [info.node_name for info in self._node.get_publishers_info_by_topic(topic)]

    def subscribers(self, topic: str) -> list[str]:
        """Names of the nodes that subscribe to a topic."""
        return [info.node_name for info in self._node.get_subscriptions_info_by_topic(topic)]


def _rclpy() -> Any:
    """The module rclpy, from a sourced installation of ROS 2 or from this environment."""
    filterwarnings("ignore", category=DeprecationWarning, module="lark")  # a parser that rclpy depends on
    try:
        return import_module("rclpy")
    except ImportError as error:
        remedy = "source ROS 2's setup script or, with Python 3.11 to 3.13, run: pip install 'sarsim[ros]'"
        raise InputError(f"rclpy cannot be imported ({error}); {remedy}") from error
