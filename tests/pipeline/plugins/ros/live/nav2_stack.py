"""Stands in for Nav2 on the network of one thread: it serves NavigateToPose and drives the robot by velocities."""

import numpy as np

from pipeline.arrays import Place, Pose
from pipeline.datasets.messages import pose_matrix, seconds
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.live.actions import GoalEnd
from pipeline.plugins.ros.messages import decode
from pipeline.robot import Velocity
from pipeline.transforms import wrap_angle, yaw_of
from tests.pipeline.plugins.ros.live.loopback import End, Goal, Wire

NEAR, ALONG = 0.05, 0.06
"""m and rad within which a goal is reached."""


class Nav2Stack:
    """Turns to its goal, drives straight to it and turns to its heading; a robot that does not move gives up.

    It knows the robot by its odometry alone, so goals must be in that frame.

    Attributes:
        goals: all that were sent, with the place of each: x, y and heading.
        patience: s without moving after which a goal is aborted.
    """

    def __init__(self, wire: Wire, name: str = "/navigate_to_pose", odom: str = "/odom"):
        self.end, self.goals, self.patience = End(wire, "nav2"), list[tuple[Goal, Place]](), 3.0
        self.accepts = True
        self._anchor, self._since = np.eye(4), 0.0
        self._is_there = False
        self.end.subscribe(odom, self._take_odometry)
        self.end.serve(name, self._take_goal)

    @property
    def places(self) -> list[Place]:
        return [place for _, place in self.goals]

    @property
    def ends(self) -> list[GoalEnd | None]:
        return [goal.end for goal, _ in self.goals]

    def _take_goal(self, goal: Goal) -> None:
        pose = decode(goal.fields["pose"], "geometry_msgs/msg/PoseStamped")
        assert pose.header.frame_id == "odom"
        T = pose_matrix(pose.pose.position, pose.pose.orientation)
        if self.goals and self.goals[-1][0].end is None:
            self.goals[-1][0].end = GoalEnd.ABORTED
        self.goals.append((goal, np.append(T[:2, 3], yaw_of(T))))
        self._anchor, self._is_there = np.full((4, 4), np.inf), False
        if not self.accepts:
            goal.end = GoalEnd.REJECTED

    def _take_odometry(self, data: bytes) -> None:
        if not self.goals or self.goals[-1][0].end is not None:
            return
        message = decode(data, "nav_msgs/msg/Odometry")
        T = pose_matrix(message.pose.pose.position, message.pose.pose.orientation)
        (goal, place), time = self.goals[-1], seconds(message.header.stamp)
        command = self._command(T, place)
        if goal.is_cancelled:
            goal.end = GoalEnd.CANCELED
        elif command == Velocity():
            goal.end = GoalEnd.SUCCEEDED
        elif self._is_stuck(T, time):
            goal.end, goal.why = GoalEnd.ABORTED, "failed to make progress"
        if goal.end is not None:
            command = Velocity()
        self.end.publish("/cmd_vel", time, messages.velocity(command))

    def _command(self, T: Pose, place: Place) -> Velocity:
        """The next velocity; none where the robot is at its goal."""
        way = place[:2] - T[:2, 3]
        self._is_there = self._is_there or bool(np.linalg.norm(way) < NEAR)
        wanted = place[2] if self._is_there else np.arctan2(way[1], way[0])
        error = float(wrap_angle(wanted - yaw_of(T)))
        if abs(error) > (ALONG if self._is_there else 0.3):
            return Velocity(0.0, float(np.clip(2 * error, -0.6, 0.6)))
        return Velocity() if self._is_there else Velocity(min(0.3, float(np.linalg.norm(way))), error)

    def _is_stuck(self, T: Pose, time: float) -> bool:
        if not np.allclose(T, self._anchor, rtol=0, atol=0.02):
            self._anchor, self._since = T, time
        return time > self._since + self.patience
