"""Stretches: lines joined by arcs, which the robot drives in one direction without stopping.

A plan has a turn in place at each bend. Where there is room, an arc replaces this turn, so that the robot need not
stop.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise

import numpy as np

from pipeline.arrays import Mask, Place, Places, Pose, Values
from pipeline.errors import InputError, require_at_least, require_positive
from pipeline.transforms import transform_points, wrap_angle, yaw_of

Fits = Callable[[Places], bool]
"""Function that returns whether the footprint has room at all poses (N, 3): x and y, m, and direction of travel,
rad."""

TANGENT_ANGLE, MAX_ROUNDS = float(np.radians(1)), 8
"""Angle, rad, up to which a line between two arcs counts as a tangent of both, and number of rounds to find it."""


@dataclass(frozen=True)
class ArcConfig:
    """Which arcs replace turns in place.

    Attributes:
        radii: radii of the arcs, in the order in which they are tried, m.
        max_angle: maximum angle of an arc, rad; for larger angles, the robot turns in place.
        min_angle: minimum angle of an arc, rad; for smaller angles, the robot needs neither an arc nor a turn.
        spacing: distance between successive poses of a stretch, m.
    """

    radii: tuple[float, ...] = (0.6, 0.45, 0.3, 0.2)
    max_angle: float = float(np.radians(120))
    min_angle: float = float(np.radians(5))
    spacing: float = 0.02

    def __post_init__(self) -> None:
        """Raise InputError if no stretch could be made with these settings."""
        require_positive("navigation.arcs", self, "spacing")
        require_at_least(0, "navigation.arcs", self, "max_angle", "min_angle")
        if not all(radius > 0 for radius in self.radii):
            raise InputError(f"navigation.arcs.radii = {self.radii}: must be greater than 0")


@dataclass(frozen=True, eq=False)
class Stretch:
    """A drive in one direction without stopping.

    Attributes:
        poses: (N, 3) x and y, m, and the direction of travel, rad; N is at least 2.
        backwards: whether the robot drives backwards.
    """

    poses: Places
    backwards: bool

    @property
    def heading(self) -> float:
        """Heading of the robot at the first pose, rad."""
        return float(self.poses[0, 2]) + np.pi * self.backwards

    @property
    def last_heading(self) -> float:
        """Heading of the robot at the last pose, rad."""
        return float(self.poses[-1, 2]) + np.pi * self.backwards

    @cached_property
    def distances_along(self) -> Values:
        """(N,) m, distances along the stretch from the first pose to each pose."""
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self.poses[:, :2], axis=0), axis=1)))

    @property
    def length(self) -> float:
        """Length of the stretch, m."""
        return float(self.distances_along[-1])

    def nearest(self, place: Place, after: int) -> int:
        """Index of the pose nearest to a position (2,), m, among the poses on the half metre from index ``after``."""
        ahead = self.poses[after : after + self._window, :2]
        return after + int(np.linalg.norm(ahead - place, axis=1).argmin())

    @property
    def _window(self) -> int:
        return 1 + int(0.5 * len(self.poses) / max(self.length, 0.5))

    def offsets(self, place: Place, at: int) -> tuple[float, float]:
        """Remaining distance, m, and offset to the left, m, of a position (2,), m, near the pose of index ``at``."""
        x, y, direction = self.poses[at]
        (a, b), off = _unit(direction), place - (x, y)
        return self.length - float(self.distances_along[at] + a * off[0] + b * off[1]), float(a * off[1] - b * off[0])

    def curvature_at(self, at: int, ahead: float) -> float:
        """Curvature ``ahead`` m past the pose of index ``at``, 1/m."""
        index = np.searchsorted(self.distances_along, self.distances_along[at] + ahead)
        return float(self.curvature[index.clip(max=len(self.poses) - 1)])

    def after(self, at: int) -> "Stretch":
        """The rest of the stretch from the pose of index ``at``, but at least the last two poses."""
        return Stretch(self.poses[min(at, len(self.poses) - 2) :], self.backwards)

    def moved(self, T: Pose) -> "Stretch":
        """The stretch transformed by ``T`` to another frame with nearly the same z axis."""
        moved = transform_points(T, np.column_stack([self.poses[:, :2], np.zeros(len(self.poses))]))[:, :2]
        return Stretch(np.column_stack([moved, self.poses[:, 2] + yaw_of(T)]), self.backwards)

    def leads_to(self, other: "Stretch", max_angle: float) -> bool:
        """Whether another stretch continues in the same direction, with a turn of less than ``max_angle`` rad."""
        angle = wrap_angle(other.poses[0, 2] - self.poses[-1, 2])
        return self.backwards == other.backwards and bool(abs(angle) < max_angle)

    def joined_with(self, other: "Stretch") -> "Stretch":
        """This stretch joined to the stretch ``other``, which follows it."""
        return Stretch(_joined([self.poses, other.poses]), self.backwards)

    @cached_property
    def curvature(self) -> Values:
        """(N,) curvatures, 1/m, positive to the left; the last pose has the curvature of the previous pose."""
        turned = wrap_angle(np.diff(self.poses[:, 2]))
        lengths = np.diff(self.distances_along)
        return np.append(turned, turned[-1]) / np.append(lengths, lengths[-1])


def stretches_of(
    waypoints: Places,
    backwards: Mask,
    start: Place,
    heading: float | None,
    fits: Fits,
    config: ArcConfig = ArcConfig(),
) -> list[Stretch]:
    """The stretches of a path; between two stretches, the robot turns in place or reverses its direction.

    Args:
        waypoints: (N, 2) positions, m, the end of the path last.
        backwards: (N,) whether the robot drives backwards to each waypoint.
        start: (3,) x and y, m, and heading, rad, of the robot at the start.
        heading: heading of the robot at the end, rad; None for any. If no arc to this heading fits, the last stretch
            ends with another heading.
        fits: returns whether the footprint has room at all of the given poses.
        config: settings of the arcs.
    """
    result: list[Stretch] = []
    number = 0
    for back, group in groupby(backwards.tolist()):
        places = waypoints[number : (number := number + len(list(group)))]
        end = None if heading is None or number < len(waypoints) else heading + np.pi * back
        for poses in _ArcFitter(fits, config).with_arcs(start + np.array([0, 0, np.pi * back]), places, end):
            result.append(Stretch(poses, back))
        if result:
            start = np.append(places[-1], result[-1].last_heading)
    return result


class _ArcFitter:
    """Joins straight lines by arcs where there is room."""

    def __init__(self, fits: Fits, config: ArcConfig):
        self._fits, self._config = fits, config
        self._finished: list[Places] = []
        self._current: list[Places] = []

    def with_arcs(self, start: Place, places: Places, end: float | None) -> list[Places]:
        """(M, 3) poses of each stretch from a pose (3,) through positions (N, 2).

        If an arc fits, the last stretch ends in direction ``end``, rad; None for any direction.
        """
        places = np.array(
            [p for a, p in pairwise([start[:2], *places]) if np.linalg.norm(p - a) > self._config.spacing]
        )
        if not len(places):
            return []
        if len(places) == 1:
            first, last = self._arcs_of_line(start, places[0], end)
        else:
            last = self._arc_in(places[-2], places[-1], end)
            first = self._arc_out(start, places[0])
        goals = [*places[:-1], places[-1] if last is None else last[0, :2]]
        here = start[:2]
        if first is not None:
            self._current.append(first)
            here = first[-1, :2]
        for number, (corner, after) in enumerate(pairwise(goals), start=2):
            here = self._add_corner(here, corner, after, is_last=number == len(goals))
        self._add_line(here, goals[-1])
        if last is not None:
            self._current.append(last)
        self._end_stretch()
        return self._finished

    def _arcs_of_line(self, start: Place, place: Place, end: float | None) -> tuple[Places | None, Places | None]:
        """Arcs from a pose (3,) to a line and from this line to a position (2,) in direction ``end``, rad.

        They are fitted to each other's ends in turn, until the line between them is a tangent of both.
        """
        last = self._arc_in(start[:2], place, end)
        for _ in range(MAX_ROUNDS):
            if last is None:
                break
            first = self._arc_out(start, last[0, :2])
            if first is None:
                return None, self._arc_in(start[:2], place, end)
            if abs(wrap_angle(first[-1, 2] - last[0, 2])) < TANGENT_ANGLE:
                return first, last
            last = self._arc_in(first[-1, :2], place, end)
        return self._arc_out(start, place), None

    def _add_corner(self, here: Place, corner: Place, after: Place, is_last: bool) -> Place:
        """Add the line to a corner, rounded by an arc if one fits; return the start of the next line."""
        before, beyond = _direction(here, corner), _direction(corner, after)
        angle = float(wrap_angle(beyond - before))
        reach = np.linalg.norm(corner - here), np.linalg.norm(after - corner) * (1.0 if is_last else 0.5)
        for radius in self._radii(angle):
            tangent = radius * np.tan(abs(angle) / 2)
            if tangent > min(reach):
                continue
            arc = self._arc(np.append(corner - tangent * _unit(before), before), angle, radius)
            if self._fits(arc):
                self._add_line(here, arc[0, :2])
                self._current.append(arc)
                return arc[-1, :2]
        self._add_line(here, corner)
        if abs(angle) > self._config.min_angle:
            self._end_stretch()
        return corner

    def _arc_out(self, start: Place, target: Place) -> Places | None:
        """An arc from a pose (3,) to a line that leads straight to a position (2,); None if no arc fits."""
        for radius in self._radii(float(wrap_angle(_direction(start[:2], target) - start[2]))):
            angle = _angle_to(start, target, radius)
            if angle is None or abs(angle) > self._config.max_angle:
                continue
            arc = self._arc(start, angle, radius)
            if self._fits(np.vstack([arc, self._straight(arc[-1, :2], target)])):
                return arc
        return None

    def _arc_in(self, before: Place, place: Place, end: float | None) -> Places | None:
        """An arc from the end of a line to a position (2,) in direction ``end``, rad; None if no arc fits.

        ``before``: (2,) start of the line, m.
        """
        if end is None:
            return None
        back = self._arc_out(np.append(place, end + np.pi), before)
        return None if back is None else back[::-1] + np.array([0, 0, np.pi])

    def _radii(self, angle: float) -> Sequence[float]:
        is_arc = self._config.min_angle < abs(angle) <= self._config.max_angle
        return self._config.radii if is_arc else ()

    def _arc(self, pose: Place, angle: float, radius: float) -> Places:
        number = max(2, int(np.ceil(abs(angle) * radius / self._config.spacing)) + 1)
        directions, side = pose[2] + np.linspace(0.0, angle, number), np.sign(angle) * radius
        centre = pose[:2] + side * np.array([-np.sin(pose[2]), np.cos(pose[2])])
        return np.column_stack(
            [centre + side * np.column_stack([np.sin(directions), -np.cos(directions)]), directions]
        )

    def _straight(self, here: Place, there: Place) -> Places:
        number = max(2, int(np.ceil(np.linalg.norm(there - here) / self._config.spacing)) + 1)
        return np.column_stack([np.linspace(here, there, number), np.full(number, _direction(here, there))])

    def _add_line(self, here: Place, there: Place) -> None:
        if np.linalg.norm(there - here) > self._config.spacing / 2:
            self._current.append(self._straight(here, there))

    def _end_stretch(self) -> None:
        if self._current:
            self._finished.append(_joined(self._current))
        self._current = []


def _joined(parts: list[Places]) -> Places:
    """(N, 3) poses of successive parts, without poses at the same position as the previous pose."""
    poses = np.vstack(parts)
    moved = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1) > np.finfo(np.float32).eps
    return poses[np.append(True, moved)]


def _angle_to(pose: Place, target: Place, radius: float) -> float | None:
    """Angle, rad, of the arc from a pose (3,) to a line that leads straight to a position (2,).

    None if the position is inside the arc's circle.
    """
    side = float(np.sign(wrap_angle(_direction(pose[:2], target) - pose[2]))) or 1.0
    centre = pose[:2] + side * radius * np.array([-np.sin(pose[2]), np.cos(pose[2])])
    to_target = target - centre
    distance = float(np.linalg.norm(to_target))
    if distance <= radius:
        return None
    line = np.sqrt(distance**2 - radius**2)
    direction = np.arctan2(to_target[1], to_target[0]) + side * np.arctan2(radius, line)
    return float(side * ((side * (direction - pose[2])) % (2 * np.pi)))


def _direction(here: Place, there: Place) -> float:
    return float(np.arctan2(there[1] - here[1], there[0] - here[0]))


def _unit(direction: float) -> Place:
    return np.array([np.cos(direction), np.sin(direction)])
