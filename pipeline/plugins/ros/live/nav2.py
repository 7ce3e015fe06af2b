"""A robot that its own Nav2 stack drives: viewpoints are goals of NavigateToPose, and no velocities are sent.

Goals are given in the robot's ``odom`` frame, because Nav2's transforms contain ``odom`` whether or not Nav2 has a
map. The pipeline knows the pose of ``odom`` in its own ``map``.
"""

import logging
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Values
from pipeline.navigation.commands import STOP, Outcome, Send, Verdict
from pipeline.navigation.config import NavigationConfig
from pipeline.navigation.course import Course
from pipeline.navigation.navigator import STILL, DrivenLeg, Navigator, leg_outcome
from pipeline.planning.path_plan import place_name
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.config import Nav2Config
from pipeline.plugins.ros.live.actions import Action, ActionGoal, GoalEnd
from pipeline.plugins.ros.live.ros_robot import RosRobot
from pipeline.robot import Velocity
from pipeline.transforms import from_yaw, inverse, wrap_angle, yaw_of

_log = logging.getLogger(__name__)
ACTION_NAME, ACTION_TYPE = "navigate_to_pose", "nav2_msgs/action/NavigateToPose"  # The name has no namespace
STATUS_SUFFIX = "/_action/status"
"""Suffix that turns the name of an action into the name of its status topic."""
OUTCOMES = {Verdict.DONE: Outcome.DONE, Verdict.UNSURE: Outcome.UNSURE, Verdict.SPINNING: Outcome.STUCK}
"""Outcome of a drive for each verdict after which the drive must not, or need not, continue."""
LATEST = 0.0
"""Timestamp of goals, s, for which Nav2 uses the latest transform."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GoTo(Velocity):
    """A command to drive to a pose, at velocities of Nav2's choice.

    Attributes:
        goal: (3,) x, y in m and heading in rad, in ``odom``.
    """

    goal: Values


class Nav2Robot(RosRobot):
    """A robot on ROS topics whose Nav2 stack follows :class:`GoTo`; any other command ends the drive."""

    _goal: ActionGoal | None = None

    @property
    def has_arrived(self) -> bool | None:
        """Whether Nav2 reached the newest goal; None while it drives there, or without a goal."""
        end = None if self._goal is None else self._goal.end
        return None if end is None else end is GoalEnd.SUCCEEDED

    def stop(self) -> None:
        """End the drive, and wait briefly for Nav2 to confirm the end."""
        super().stop()
        if (goal := self._goal) is not None:
            self._node.wait(lambda: goal.end is not None, self._config.discovery_timeout)

    def _missing_receivers(self) -> list[str]:
        if self._served_name():
            return []
        ending = f"/{ACTION_NAME}{STATUS_SUFFIX}"
        others = [topic.removesuffix(STATUS_SUFFIX) for topic in self._node.types() if topic.endswith(ending)]
        there = f" (found {', '.join(others)}; set --topics.odom to a topic in its namespace)" if others else ""
        return [f"no Nav2 action server offers {self._possible_names()[0]}{there}"]

    def _prepare_commands(self) -> None:
        name = self._served_name()
        self._action: Action = self._node.action(name, ACTION_TYPE)
        _log.warning("sending Nav2 goals to %s, in the frame of %s", name, self.topics.odom)

    def _served_name(self) -> str:
        """The name of the action; empty if no node serves it."""
        return next((name for name in self._possible_names() if self._node.publishers(name + STATUS_SUFFIX)), "")

    def _possible_names(self) -> list[str]:
        """The possible names of the action, in the namespace of the odometry and in its parent namespaces."""
        spaces = f"/{self.topics.odom.strip('/')}".split("/")[:-1]
        return ["/".join([*spaces[:depth], ACTION_NAME]) for depth in range(len(spaces), 0, -1)]

    def _send(self, command: Velocity) -> None:
        before, self._last_command, self._command_time = self._last_command, command, self._senses.time
        if not isinstance(command, GoTo):
            if self._goal is not None:
                self._goal.cancel()
        elif command is not before:
            x, y, heading = command.goal
            pose = messages.pose_stamped(LATEST, self._senses.odom_frame, from_yaw(x, y, 0.0, heading))
            self._goal = self._action.send(pose=pose)

    def _on_idle(self) -> None:
        """Do nothing, because Nav2 keeps the robot safe while the pipeline computes."""

    def why_ended(self) -> str:
        """How the newest goal ended, according to Nav2."""
        goal = self._goal
        if goal is None or goal.end is None:
            return "not ended"
        return f"{goal.end.name.lower()}{goal.why and f' ({goal.why})'}"


class Nav2Navigator(Navigator):
    """Navigates a robot that its Nav2 stack drives: the end of each path is a goal, at which the robot stops."""

    def __init__(
        self, robot: Nav2Robot, config: NavigationConfig = NavigationConfig(), nav2: Nav2Config = Nav2Config()
    ):
        super().__init__(robot.model, robot.control_period, config)
        self._body, self._nav2 = robot, nav2

    def halt(self, send: Send) -> Outcome:
        """End the drive, and wait until the robot has stopped, for at most ``braking`` s."""
        send(STOP)
        end = self._time + self._nav2.braking
        while self._speed > STILL and self._time < end:
            send(STOP)
        return Outcome.REACHED

    def turn(self, angle: float, send: Send) -> Outcome:
        """Turn in place by an angle, rad, counter-clockwise."""
        self.halt(send)
        T = self.T_map_base
        return self._go_to(np.append(T[:2, 3], yaw_of(T) + angle), 0.0, send)

    def _follow(self, course: Course, send: Send) -> Outcome:
        self.halts, self.track = [], []
        way, heading = course.stretches, course.heading
        send(STOP)
        here = self.T_map_base[:2, 3]
        end = way[-1].poses[-1, :2] if way else here
        heading = way[-1].last_heading if heading is None and way else heading
        outcome = Outcome.CARRIED
        if not self._is_elsewhere(course.start):
            heading = yaw_of(self.T_map_base) if heading is None else heading
            length = sum(stretch.length for stretch in way)
            outcome = self._go_to(np.append(end, heading), length, send)
        self.legs.append(DrivenLeg(end, leg_outcome(outcome)))
        return outcome

    def _go_to(self, goal: Values, length: float, send: Send) -> Outcome:
        """Let Nav2 drive to a goal.

        Args:
            goal: (3,) x and y, m, and heading, rad, in ``map``.
            length: length of the path, m.
            send: sends a command and returns a verdict on it.
        """
        command = GoTo(goal=self._in_odom(goal))
        latest = self._time + self._nav2.patience + length / self._nav2.min_speed
        while True:
            outcome = self._outcome(send(command), goal, latest)
            if outcome is not None:
                self.halt(send)
                return outcome
            if self._has_shifted(command.goal, corrected := self._in_odom(goal)):
                command = GoTo(goal=corrected)

    def _outcome(self, verdict: Verdict, goal: Values, latest: float) -> Outcome | None:
        """The outcome of a drive to a goal, which may last until ``latest``, s; None if the drive has not ended."""
        if verdict in OUTCOMES:
            return OUTCOMES[verdict]
        if self._was_carried:
            return Outcome.CARRIED
        if (has_arrived := self._body.has_arrived) is not None:
            if not has_arrived:
                _log.warning("Nav2 did not reach the goal %s: %s", place_name(goal[:2]), self._body.why_ended())
            return Outcome.REACHED if has_arrived else Outcome.BLOCKED
        return Outcome.STUCK if self._time > latest else None

    def _in_odom(self, goal: Values) -> Values:
        """A goal, (3,) x and y, m, and heading, rad, converted from ``map`` to ``odom``."""
        x, y, heading = goal
        T = inverse(self._T_map_odom) @ from_yaw(x, y, float(self.T_map_base[2, 3]), heading)
        return np.append(T[:2, 3], yaw_of(T))

    def _has_shifted(self, sent: Values, corrected: Values) -> bool:
        """Whether the map was corrected so much that a goal, (3,) in ``odom``, must be sent again."""
        shift, turn = np.linalg.norm(corrected[:2] - sent[:2]), abs(wrap_angle(corrected[2] - sent[2]))
        return bool(shift > self._nav2.moved or turn > self._nav2.turned)
