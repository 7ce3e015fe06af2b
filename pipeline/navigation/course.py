"""Courses: the stretches that a robot has to drive, how fast, and how they end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pipeline.arrays import Place, Values
from pipeline.planning.stretches import Stretch

SpeedAlong = Callable[[Stretch], Values]
"""Returns the (N,) maximum speeds at the poses of a stretch, m/s."""


@dataclass(frozen=True, eq=False)
class Course:
    """A path, and how to drive it.

    Attributes:
        stretches: from where the robot stands, or will come to rest; may be empty if there is a heading.
        heading: heading of the robot at the end, rad; None for any.
        start: (2,) position of the robot when the path was planned, m; a robot that is elsewhere was carried. None
            to skip this check.
        speed_along: speed limits set by the ground; None for the robot's own limit.
        rolls: whether the robot need not stop at the end. It then counts as arrived where it must begin to brake, and
            continues with the next course from where it would come to rest, or must be halted.
        planned: expected duration of the drive, s; None if it was not planned.
    """

    stretches: Sequence[Stretch]
    heading: float | None = None
    start: Place | None = None
    speed_along: SpeedAlong | None = None
    rolls: bool = False
    planned: float | None = None
