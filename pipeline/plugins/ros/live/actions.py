"""ROS actions, whose goals another node pursues until they end."""

from enum import Enum
from importlib import import_module
from typing import Any

from pipeline.datasets.messages import Message
from pipeline.plugins.ros.live.interfaces import interface
from pipeline.plugins.ros.messages import encode, type_of


class GoalEnd(Enum):
    """How a goal ended, with the numbers of action_msgs/GoalStatus, which has no number for a rejected goal."""

    REJECTED = 0
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class ActionGoal:
    """A goal that was sent to another node.

    Attributes:
        end: how the goal ended; None while the other node pursues it.
        why: the other node's reason for the end; empty if it gives none.
    """

    def __init__(self, answer: Any):
        """Track a goal; ``answer``: rclpy's future of the goal's handle."""
        self.end: GoalEnd | None = None
        self.why = ""
        self._handle: Any = None
        self._is_cancelled = False
        answer.add_done_callback(self._take_goal_response)

    def cancel(self) -> None:
        """Ask the other node to cancel the goal, at once or as soon as that node has accepted the goal."""
        was_cancelled, self._is_cancelled = self._is_cancelled, True
        if self._handle is not None and self.end is None and not was_cancelled:
            self._handle.cancel_goal_async()

    def _take_goal_response(self, answer: Any) -> None:
        handle = answer.result()
        if not handle.accepted:
            self.end = GoalEnd.REJECTED
            return
        self._handle = handle
        handle.get_result_async().add_done_callback(self._take_result)
        if self._is_cancelled:
            handle.cancel_goal_async()

    def _take_result(self, answer: Any) -> None:
        response = answer.result()
        # Which of these two fields a result has depends on the release of Nav2.
        code = getattr(response.result, "error_code", 0)
        self.why = getattr(response.result, "error_msg", "") or (f"error {code}" if code else "")
        ends = {end.value: end for end in GoalEnd}
        self.end = ends.get(response.status, GoalEnd.ABORTED)


class Action:
    """An action that another node serves."""

    def __init__(self, client: Any, kind: Any):
        """Use rclpy's action client ``client`` for an action of the class ``kind``."""
        self._client, self._kind = client, kind

    def send(self, **fields: Message) -> ActionGoal:
        """Send a goal, which replaces any goal that is being pursued; ``fields``: messages by the goal's field."""
        goal = self._kind.Goal()
        deserialize = import_module("rclpy.serialization").deserialize_message
        for name, message in fields.items():
            setattr(goal, name, deserialize(encode(message), interface(type_of(message))))
        return ActionGoal(self._client.send_goal_async(goal))
