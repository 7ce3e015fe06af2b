"""Lower bounds on driving times, from a robot's maximum speeds and accelerations alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import atan2, hypot, pi, sqrt

from pipeline.arrays import Mask, Places
from pipeline.transforms import wrap_angle
from sarsim.robots.skid_steer import DriveModel


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive of straight lines and turns from one viewpoint to the next.

    Attributes:
        stops: (N, 2) m, the ends of the lines, beginning with the start of the drive.
        backwards: (N - 1,) which of the lines are driven backwards.
        first, last: headings at the two viewpoints, rad.
    """

    stops: Places
    backwards: Mask
    first: float
    last: float

    @property
    def lines(self) -> list[tuple[float, bool, float]]:
        """Length in m of each line, whether it is driven backwards, and the robot's heading on it, rad."""
        steps = [(b - a).tolist() for a, b in pairwise(self.stops)]
        return [
            (hypot(x, y), bool(back), atan2(y, x) + pi * bool(back))
            for (x, y), back in zip(steps, self.backwards, strict=True)
            if x or y
        ]

    @property
    def turned(self) -> float:
        """Sum of all turns, rad."""
        headings = [self.first, *(heading for _, _, heading in self.lines), self.last]
        return float(sum(abs(wrap_angle(b - a)) for a, b in pairwise(headings)))


def least_seconds(drives: Sequence[Drive], body: DriveModel) -> float:
    """Lower bound on the time that a body needs for consecutive drives, s.

    The longer of two times: for all lines at maximum speed and acceleration, with stops only where the direction
    reverses; and for all turns at the maximum rate, because an ideal driver turns while driving.
    """
    lines = [line for drive in drives for line in drive.lines]
    ways = [sum(way for way, *_ in run) for _, run in groupby(lines, key=lambda line: line[1])]
    driving = sum(_seconds(way, body, stops=n < len(ways)) for n, way in enumerate(ways, 1))
    return max(driving, sum(drive.turned for drive in drives) / body.top_turn_rate)


def _seconds(way: float, body: DriveModel, stops: bool) -> float:
    """Time, s, to drive ``way``, m, from a standstill, and to a standstill if the body ``stops`` at the end."""
    v, a, ends = body.top_speed, body.acceleration, 2 if stops else 1
    # Accelerating or braking takes v / a s, and covers half the distance that top speed would.
    if way < ends * v**2 / (2 * a):
        return sqrt(2 * ends * way / a)
    return way / v + ends * v / (2 * a)
