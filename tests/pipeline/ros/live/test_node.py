"""Nodes of ROS 2 on this machine, through the middleware that robots use."""

import os
from collections.abc import Iterator

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.robot import Velocity
from pipeline.ros import messages
from pipeline.ros.live.node import RosNode
from pipeline.ros.messages import decode, type_of

pytest.importorskip("rclpy", reason="there is no ROS 2 here; make ros adds it")
pytestmark = pytest.mark.ros
LONG = 20.0
"""s that a message may take on a machine that is busy."""


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[RosNode, RosNode]]:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    nodes = RosNode("test_robot"), RosNode("test_explorer")
    yield nodes
    for node in nodes:
        node.close()


def test_messages_arrive_as_they_were_sent(pair: tuple[RosNode, RosNode]) -> None:
    robot, explorer = pair
    pixels = np.random.default_rng(0).integers(0, 255, (480, 640, 3), np.uint8)
    sent = {
        "/image": messages.image(1.5, "rgb8", pixels),
        "/odom": messages.odometry(1.5, np.eye(4), Velocity(0.2, 0.1)),
        "/twist": messages.velocity_stamped(1.5, Velocity(0.2, 0.1)),
        "/tf_static": messages.transforms(1.5, {("base_link", "camera"): np.eye(4)}),
    }
    got: dict[str, list[bytes]] = {topic: [] for topic in sent}
    for topic, message in sent.items():
        robot.send(topic, 1.5, message)
    # Of transforms there is no type in the packages of PyPI.
    there = [topic for topic in sent if explorer.wait(lambda topic=topic: topic in explorer.types(), LONG / 10)]
    assert set(sent) - {"/tf_static"} <= set(there)
    for topic in there:
        explorer.listen(topic, got[topic].append)
    for _ in range(100):
        for topic in there:
            robot.send(topic, 1.5, sent[topic])
        if explorer.wait(lambda: all(got[topic] for topic in there), LONG / 100):
            break
    for topic in there:
        assert explorer.senders(topic) == ["test_robot"]
        assert messages.encode(decode(got[topic][0], type_of(sent[topic]))) == messages.encode(sent[topic])


def test_a_late_listener_gets_the_map(pair: tuple[RosNode, RosNode]) -> None:
    robot, explorer = pair
    robot.send("/camera/transform", 0.0, messages.transform(0.0, "base_link", "camera", np.eye(4)))
    assert explorer.wait(lambda: explorer.senders("/camera/transform") == ["test_robot"], LONG)
    got: list[bytes] = []
    explorer.listen("/camera/transform", got.append)
    assert explorer.wait(lambda: bool(got), LONG)


def test_of_two_nodes_with_one_name_the_second_is_refused(pair: tuple[RosNode, RosNode]) -> None:
    with pytest.raises(InputError, match=r"'test_robot'.*--name"):
        RosNode("test_robot")
    with pytest.raises(InputError, match="--name a b"):
        RosNode("a b")
