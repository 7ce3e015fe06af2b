"""What a robot has to drive: the stretches of a plan, their speeds and how they end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pipeline.arrays import Place, Values
from pipeline.planning.stretches import Stretch

SpeedAlong = Callable[[Stretch], Values]
"""(N,) m/s, the greatest speeds at the poses of a stretch."""


@dataclass(frozen=True, eq=False)
class Course:
    """A way, and how it is to be driven.

    Attributes:
        way: from where the robot stands, or rolls to; at least a heading if there are no stretches.
        heading: rad, of the robot at the end; None for any.
        start: (2,) m, where the robot was when the way was planned: one that is elsewhere was carried.
            None for anywhere.
        speed_along: speed limits set by the ground; None for the robot's own limit.
        rolls: whether the robot need not stand at the end. It has reached the end where it must brake for it, and
            goes on with the next course from where it would come to rest, or else must be halted.
        planned: s that the drive should take; None if it was not planned.
    """

    way: Sequence[Stretch]
    heading: float | None = None
    start: Place | None = None
    speed_along: SpeedAlong | None = None
    rolls: bool = False
    planned: float | None = None
