"""Courses: the stretches that a robot has to drive, their speed limits, and how they end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pipeline.arrays import Place, Values
from pipeline.planning.stretches import Stretch

SpeedAlong = Callable[[Stretch], Values]
"""Returns the (N,) maximum speeds at the poses of a stretch, m/s."""


@dataclass(frozen=True, eq=False)
class Course:
    """A path, its speed limits and its end.

    Attributes:
        stretches: the stretches to drive, from where the robot stands or will come to rest; may be empty if a heading
            is given.
        heading: heading of the robot at the end, rad; None for any.
        start: (2,) position of the robot when the path was planned, m; a robot that is elsewhere was carried. None
            to skip this check.
        speed_along: speed limits set by the ground; None for the robot's own limit.
        rolls: whether the robot need not stop at the end. It has then arrived as soon as it must begin to brake. The
            next course begins where the robot would come to rest; without a next course, it must be halted.
        planned: expected duration of the drive, s; None if the drive was not planned.
    """

    stretches: Sequence[Stretch]
    heading: float | None = None
    start: Place | None = None
    speed_along: SpeedAlong | None = None
    rolls: bool = False
    planned: float | None = None
