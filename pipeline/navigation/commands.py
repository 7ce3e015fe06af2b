"""The navigator's commands to the robot, the verdicts on commands, and the outcomes of drives."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from pipeline.arrays import Places
from pipeline.planning.stretches import Stretch
from pipeline.robot import Velocity


class Turn(Velocity):
    """A command to turn in place; a speed ``v`` other than 0 compensates for sliding on a ramp."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Approach(Velocity):
    """A command to drive along a stretch.

    Attributes:
        stretch: the stretch that the robot follows.
        at: index of the stretch's pose nearest to the robot.
    """

    stretch: Stretch
    at: int

    @property
    def path(self) -> Places:
        """(N, 2) positions from the robot to the end of the stretch, m."""
        return self.stretch.after(self.at).poses[:, :2]

    @property
    def direction(self) -> float:
        """Direction of travel, rad."""
        return float(self.stretch.poses[self.at, 2])

    @property
    def remaining_length(self) -> float:
        """Remaining length of the stretch, m."""
        return self.stretch.length - float(self.stretch.distances_along[self.at])


STOP = Velocity()


class Verdict(Enum):
    """Whether the robot may follow a command; only ``FINE`` means that it may."""

    FINE = "it moves as the odometry says, and the path is clear"
    DONE = "the purpose of the drive is fulfilled"
    SPINNING = "its wheels spin, but it does not move"
    UNSURE = "its pose is uncertain"
    BLOCKED = "an obstacle blocks the path"


class Outcome(Enum):
    """How a leg or a course ended."""

    REACHED = "the target was reached"
    DONE = "its purpose was fulfilled early"
    STUCK = "the robot is stuck"
    TILTED = "the robot tilted too far"
    BLOCKED = "the path is blocked"
    """An obstacle that the map does not show blocks the path."""
    SLID = "in the turn to its next stretch, the robot slid too far off it"
    CARRIED = "the robot was carried elsewhere"
    UNSURE = "the robot is unsure of its pose and looks around"


Send = Callable[[Velocity], Verdict]
"""Function that takes a command for one control period and returns a verdict on it. If the verdict is ``FINE``, the
robot has followed the command, and the navigator has received the resulting motion."""
