"""Courses: the stretches that a robot has to drive, their speed limits, and the end of the drive."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pipeline.arrays import Place, Values
from pipeline.planning.stretches import Stretch

SpeedAlong = Callable[[Stretch], Values]
"""Function that returns the (N,) maximum speeds at the poses of a stretch, m/s."""


@dataclass(frozen=True, eq=False)
class Course:
    """A path to drive, its speed limits, and how the drive ends.

    Attributes:
        stretches: stretches to drive, beginning where the robot stands or will come to rest; may be empty if a
            heading is given.
        heading: heading of the robot at the end, rad; None for any.
        start: (2,) position of the robot when the path was planned, m; a robot that is far from this position has
            been carried. None to skip this check.
        speed_along: speed limits along a stretch; None for the robot's own limit.
        may_roll: whether the robot may arrive without stopping. It has then arrived as soon as it must begin to
            brake, and the next course begins where it would come to rest. Without a next course, the robot must be
            halted.
        planned_duration: expected duration of the drive, s; None if unknown.
    """

    stretches: Sequence[Stretch]
    heading: float | None = None
    start: Place | None = None
    speed_along: SpeedAlong | None = None
    may_roll: bool = False
    planned_duration: float | None = None
