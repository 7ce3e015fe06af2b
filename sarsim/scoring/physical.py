"""How soon a body could have driven a way, by its greatest speeds and accelerations alone."""

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
        stops: (N, 2) m, the ends of the lines, the first being where it begins.
        backwards: (N - 1,) which of the lines lead backwards.
        first, last: rad, the headings at the viewpoints.
    """

    stops: Places
    backwards: Mask
    first: float
    last: float

    @property
    def lines(self) -> list[tuple[float, bool, float]]:
        """Length in m of each line, whether it leads backwards, and the robot's heading on it, rad."""
        steps = [(b - a).tolist() for a, b in pairwise(self.stops)]
        return [
            (hypot(x, y), bool(back), atan2(y, x) + pi * bool(back))
            for (x, y), back in zip(steps, self.backwards, strict=True)
            if x or y
        ]

    @property
    def turned(self) -> float:
        """rad, all turns together."""
        headings = [self.first, *(heading for _, _, heading in self.lines), self.last]
        return float(sum(abs(wrap_angle(b - a)) for a, b in pairwise(headings)))


def least_seconds(drives: Sequence[Drive], body: DriveModel) -> float:
    """Lower bound of the time that a body needs for drives one after the other.

    The longer of the time for all lines at its greatest speed and acceleration, with a stop where it reverses and no
    other, and of that for all turns at its greatest rate: who drives well turns while it drives.
    """
    lines = [line for drive in drives for line in drive.lines]
    ways = [sum(way for way, *_ in run) for _, run in groupby(lines, key=lambda line: line[1])]
    driving = sum(_seconds(way, body, stops=n < len(ways)) for n, way in enumerate(ways, 1))
    return max(driving, sum(drive.turned for drive in drives) / body.top_turn_rate)


def _seconds(way: float, body: DriveModel, stops: bool) -> float:
    """s for a way, m, from a standstill, and to one if the body ``stops`` at the end."""
    v, a, ends = body.top_speed, body.acceleration, 2 if stops else 1
    # Each end takes v / a s, on half of the way that top speed would have brought.
    if way < ends * v**2 / (2 * a):
        return sqrt(2 * ends * way / a)
    return way / v + ends * v / (2 * a)
