"""The judge of a lane, who decides from the robot's true pose, not from its map, whether a traverse is complete."""

from dataclasses import dataclass

import mujoco
import numpy as np

from pipeline.arrays import Pose
from pipeline.robot import RobotModel
from sarsim.plugins.lanes.lanes import Lane
from sarsim.scoring.trajectory import is_tipped

POST_PREFIX = "post_"
"""Prefix of the names of bodies that may fall over."""


@dataclass
class LaneJudge:
    """Judges one attempt to drive from one end zone into the other.

    Attributes:
        lane: the lane.
        robot: the robot's dimensions.
        towards: +1 or -1, the sign of x of the end zone to drive into.
        start_time: time when the attempt began, s.
        time_limit: maximum duration of the attempt, s.
        crossing_time: time when the whole robot was first inside that end zone, s; None before that.
        has_tipped: whether the robot fell over.
    """

    lane: Lane
    robot: RobotModel
    towards: int
    start_time: float
    time_limit: float
    crossing_time: float | None = None
    has_tipped: bool = False

    def see(self, time: float, T_world_base: Pose) -> bool:
        """Judge a true 4×4 pose at ``time``, s; return False if a fall or the time limit has ended the attempt."""
        self.has_tipped |= is_tipped(T_world_base)
        may_go_on = not self.has_tipped and time <= self.start_time + self.time_limit
        if (
            may_go_on
            and self.crossing_time is None
            and is_in_end_zone(T_world_base, self.towards, self.robot, self.lane)
        ):
            self.crossing_time = time
        return may_go_on

    @property
    def seconds(self) -> float | None:
        """Duration of the traverse, s; None if the traverse is not complete."""
        return None if self.crossing_time is None else self.crossing_time - self.start_time


def is_in_end_zone(T_world_base: Pose, end: int, robot: RobotModel, lane: Lane) -> bool:
    """Whether a robot's whole footprint at a true 4×4 pose is in the end zone at -x or +x (``end``: -1 or +1)."""
    along, across = np.abs(T_world_base[0, :2]) * (robot.half_length, robot.half_width)
    return bool(end * T_world_base[0, 3] - along - across >= lane.end_distance)


def fallen_posts(model: mujoco.MjModel, data: mujoco.MjData) -> set[str]:
    """The names of the posts that have fallen over."""
    posts = [body for body in map(data.body, range(model.nbody)) if body.name.startswith(POST_PREFIX)]
    return {post.name for post in posts if is_tipped(post.xmat.reshape(3, 3))}
