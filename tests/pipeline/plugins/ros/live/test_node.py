"""Nodes of ROS 2 on this machine, through the middleware that robots use."""

import os
from collections.abc import Iterator
from contextlib import closing
from importlib import import_module
from threading import Thread
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.live.actions import ActionGoal, GoalEnd
from pipeline.plugins.ros.live.node import RosNode
from pipeline.plugins.ros.messages import decode, type_of
from pipeline.robot import Velocity

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
        robot.publish(topic, 1.5, message)
    # Of transforms there is no type in the packages of PyPI.
    there = [topic for topic in sent if explorer.wait(lambda topic=topic: topic in explorer.types(), LONG / 10)]
    assert set(sent) - {"/tf_static"} <= set(there)
    for topic in there:
        explorer.subscribe(topic, got[topic].append)
    for _ in range(100):
        for topic in there:
            robot.publish(topic, 1.5, sent[topic])
        if explorer.wait(lambda: all(got[topic] for topic in there), LONG / 100):
            break
    for topic in there:
        assert explorer.publishers(topic) == ["test_robot"]
        assert messages.encode(decode(got[topic][0], type_of(sent[topic]))) == messages.encode(sent[topic])


def test_a_late_listener_gets_the_map(pair: tuple[RosNode, RosNode]) -> None:
    robot, explorer = pair
    robot.publish("/camera/transform", 0.0, messages.transform(0.0, "base_link", "camera", np.eye(4)))
    assert explorer.wait(lambda: explorer.publishers("/camera/transform") == ["test_robot"], LONG)
    got: list[bytes] = []
    explorer.subscribe("/camera/transform", got.append)
    assert explorer.wait(lambda: bool(got), LONG)


def test_a_message_that_cannot_be_read_is_an_error_while_the_node_goes_on(pair: tuple[RosNode, RosNode]) -> None:
    robot, explorer = pair
    robot.publish("/odom", 0.0, messages.odometry(1.5, np.eye(4), Velocity()))
    assert explorer.wait(lambda: "/odom" in explorer.types(), LONG)
    explorer.subscribe("/odom", lambda data: decode(data[:9], "nav_msgs/msg/Odometry"))

    def until() -> bool:
        robot.publish("/odom", 0.0, messages.odometry(1.5, np.eye(4), Velocity()))
        return False

    with pytest.raises(InputError, match=r"/odom: .*nav_msgs/msg/Odometry"):
        explorer.wait(until, LONG)
    idle: list[bool] = []
    explorer.idle = lambda: idle.append(True)
    end = monotonic() + LONG
    while not idle and monotonic() < end:
        sleep(0.01)
    assert idle


class Sleeper:
    """Serves an action whose goals say what to do: 1 succeeds, 2 is aborted, 3 is refused, any other goes on."""

    def __init__(self, kind: Any, name: str):
        rclpy, actions, executors = (import_module(f"rclpy{part}") for part in ("", ".action", ".executors"))
        self._kind, self._context = kind, rclpy.Context()
        self._context.init(args=[])
        answers = actions.GoalResponse
        self._node = rclpy.create_node("test_server", context=self._context)
        self._server = actions.ActionServer(
            self._node,
            kind,
            name,
            self._pursue,
            goal_callback=lambda goal: answers.REJECT if number_of(goal) == 3 else answers.ACCEPT,
            cancel_callback=lambda goal: actions.CancelResponse.ACCEPT,
            callback_group=import_module("rclpy.callback_groups").ReentrantCallbackGroup(),
        )
        self._executor = executors.MultiThreadedExecutor(4, context=self._context)
        self._executor.add_node(self._node)
        self._thread = Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _pursue(self, goal: Any) -> Any:
        number, end = number_of(goal.request), monotonic() + LONG
        while number > 3 and not goal.is_cancel_requested and monotonic() < end:
            sleep(0.02)
        {1: goal.succeed, 2: goal.abort}.get(number, goal.canceled)()
        return self._kind.Result()

    def close(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._server.destroy()
        self._node.destroy_node()
        self._context.try_shutdown()


def number_of(goal: Any) -> int:
    return goal.nested_different_pkg.sec


def test_goals_are_pursued_until_they_end_or_are_cancelled(pair: tuple[RosNode, RosNode]) -> None:
    kind, (_, explorer) = pytest.importorskip("test_msgs.action", reason="make ros adds it").NestedMessage, pair
    with closing(Sleeper(kind, "/nested")):
        assert explorer.wait(lambda: bool(explorer.publishers("/nested/_action/status")), LONG)
        action = explorer.action("/nested", "test_msgs/action/NestedMessage")

        def sent(number: int) -> ActionGoal:
            return action.send(nested_different_pkg=messages.stamp(float(number)))

        for number, end in ((1, GoalEnd.SUCCEEDED), (2, GoalEnd.ABORTED), (3, GoalEnd.REJECTED)):
            goal = sent(number)
            assert explorer.wait(lambda goal=goal: goal.end is not None, LONG)
            assert goal.end is end
        for seconds in (0.0, 0.5):  # before it is accepted, and after
            goal = sent(4)
            assert not explorer.wait(lambda goal=goal: goal.end is not None, seconds)
            goal.cancel()
            assert explorer.wait(lambda goal=goal: goal.end is not None, LONG)
            assert goal.end is GoalEnd.CANCELED


def test_an_action_whose_type_is_not_installed_is_refused(pair: tuple[RosNode, RosNode]) -> None:
    with pytest.raises(InputError, match=r"/fly: .*no_such_msgs"):
        pair[1].action("/fly", "no_such_msgs/action/Fly")


def test_of_two_nodes_with_one_name_the_second_is_refused(pair: tuple[RosNode, RosNode]) -> None:
    with pytest.raises(InputError, match=r"'test_robot'.*--name"):
        RosNode("test_robot")
    with pytest.raises(InputError, match="--name 'a b': must consist of letters"):
        RosNode("a b")
