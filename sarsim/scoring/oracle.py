"""The oracle: the time in which a robot that knows the true ground could see it with the same planner and camera."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby, pairwise
from math import atan2, ceil, hypot, inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pipeline.arrays import Mask, Places, Values
from pipeline.elevation_map.config import TraversabilityConfig
from pipeline.elevation_map.pose_kernels import HEADING_ANGLES
from pipeline.elevation_map.traversability import Traversability, assess
from pipeline.exploration.config import ExplorationConfig
from pipeline.grid_map import best_of_blocks
from pipeline.localisation.config import KeyframePolicy
from pipeline.planning.pose_paths import PosePaths, heading_mask, nearest_heading
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.robots.skid_steer import DriveModel
from sarsim.scoring.sight import Sight
from sarsim.scoring.view_tours import Leg, ViewTours, cells_shown

KEYFRAME_SPACING = KeyframePolicy()
"""Spacing of the keyframes on the oracle's paths: the robot's default on level ground."""
MAX_SEARCHES = 32
"""Maximum number of path searches that are kept in memory; one takes up to 70 MB on 52 × 15 m."""


def true_traversability(surface: GroundTruthSurface, robot: RobotModel) -> Traversability:
    """The whole arena as the robot's planner would represent it; all cells without connected ground are walls."""
    top = np.nanmax(surface.height) + robot.headroom
    elevation = np.where(np.isnan(surface.height) | surface.walls, top, surface.height).astype(np.float32)
    none = np.zeros(surface.grid.shape, np.bool_)
    return assess(surface.grid, elevation, none, none.astype(np.uint16), robot, TraversabilityConfig())


@dataclass(frozen=True, eq=False)
class ViewpointDrive:
    """A drive of straight lines and turns from one viewpoint to the next.

    Attributes:
        stops: (N, 2) m, the ends of the lines, beginning with the start of the drive.
        backwards: (N - 1,) bool, whether each line is driven backwards.
        first_heading, last_heading: headings at the two viewpoints, rad.
    """

    stops: Places
    backwards: Mask
    first_heading: float
    last_heading: float

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
    def total_turn(self) -> float:
        """Sum of the angles of all turns, rad."""
        headings = [self.first_heading, *(heading for _, _, heading in self.lines), self.last_heading]
        return float(sum(abs(wrap_angle(b - a)) for a, b in pairwise(headings)))


@dataclass(eq=False)
class Oracle(ViewTours):
    """Searches for the fastest tour; the first viewpoint is the start.

    Attributes:
        ground: the true ground, as the robot's planner would represent it.
        sight: computes the ground that the robot's camera sees.
        start: (3,) x and y, m, and heading, rad.
        required_fraction: fraction of the drivable ground that must be seen, 0 to 1.
        drive_model: the robot's maximum speeds and accelerations.
        config: the robot's exploration settings.
    """

    ground: Traversability
    sight: Sight
    start: NDArray[np.float64]
    required_fraction: float
    drive_model: DriveModel
    config: ExplorationConfig = field(default_factory=ExplorationConfig)
    _paths_from: dict[int, PosePaths] = field(default_factory=dict)
    _legs: dict[tuple[int, int], Leg] = field(default_factory=dict)

    @cached_property
    def poses(self) -> NDArray[np.float64]:
        """(V, 3) viewpoints: x and y, m, and heading, rad.

        The first viewpoint is the start. In each block of 0.25 m, the cell with the most possible headings
        contributes a viewpoint for each of these headings.
        """
        headings = self.paths(0).headings
        cells = best_of_blocks(np.bitwise_count(headings), self.config.visibility.stride)
        n, m = np.nonzero(heading_mask(headings[tuple(cells.T)]))
        return np.vstack(
            [self.start, np.column_stack([self.ground.grid.centre_of(cells[n]), wrap_angle(HEADING_ANGLES[m])])]
        )

    @cached_property
    def views(self) -> sparse.csr_array:
        """(V, N) bool, sparse, the cells that are seen from each viewpoint."""
        return self.sight.views(self.poses)

    @property
    def required_count(self) -> int:
        """Number of cells that must be seen."""
        return ceil(self.required_fraction * len(self.sight.cells))

    @cached_property
    def seen_at_start(self) -> Mask:
        """(N,) bool, the cells seen from the start."""
        seen = np.zeros(len(self.sight.cells), np.bool_)
        seen[cells_shown(self.views, 0)] = True
        return seen

    def paths(self, view: int) -> PosePaths:
        """The fastest paths from a viewpoint."""
        if view not in self._paths_from:
            if len(self._paths_from) == MAX_SEARCHES:
                del self._paths_from[next(iter(self._paths_from))]
            x, y, heading = self.start if view == 0 else self.poses[view]
            self._paths_from[view] = PosePaths(self.ground, [x, y], heading, caution=0.0)
        return self._paths_from[view]

    def seconds(self, here: int, there: Sequence[int] | slice = slice(None)) -> Values:
        """(M,) s, driving time from one viewpoint to each of the others."""
        poses = self.poses[there]
        cells, heading = self.ground.grid.cell_of(poses), np.cos(HEADING_ANGLES - poses[:, 2:]).argmax(axis=1)
        seconds = self.paths(here).seconds_to(cells)[np.arange(len(poses)), heading]
        return seconds.astype(np.float64)

    def leg(self, here: int, there: int) -> Leg:
        """The drive between two viewpoints, with keyframes spaced as the robot's are on level ground."""
        if (here, there) not in self._legs:
            drive, shown = self.drive(here, there), np.zeros(len(self.sight.cells), np.bool_)
            keyframes = _keyframes(drive.stops, drive.backwards, drive.first_heading, drive.last_heading)
            shown[self.sight.views(np.array([*keyframes, self.poses[there]])).indices] = True
            metres = float(np.linalg.norm(np.diff(drive.stops, axis=0), axis=1).sum())
            x, y, heading = self.poses[there]
            seconds = self.paths(here).seconds_at([x, y], nearest_heading(heading))
            self._legs[here, there] = Leg(seconds, metres, shown)
        return self._legs[here, there]

    def drive(self, here: int, there: int) -> ViewpointDrive:
        """The fastest path between two viewpoints."""
        x, y, heading = self.poses[there]
        way = self.paths(here).straightened_path_to([x, y], heading)
        return ViewpointDrive(
            np.vstack([self.poses[here, :2], way.places]), way.backwards, self.poses[here, 2], heading
        )

    @cached_property
    def physical_seconds(self) -> float:
        """Lower bound on the time of the tour for any robot with this drive, even without stops at viewpoints, s."""
        return min_seconds([self.drive(a, b) for a, b in pairwise([0, *self.fastest.order])], self.drive_model)

    def figures(self) -> dict[str, float]:
        """Figures of the tour for report.json; empty if no tour sees enough, or if the start alone does."""
        tour = self.fastest
        if not 0 < tour.seconds < inf:
            return {}
        return {"oracle_time_s": tour.seconds, "oracle_path_m": tour.metres, "physical_time_s": self.physical_seconds}

    def ratios(self, metres: float, seconds: float) -> dict[str, float]:
        """A robot's path length, m, and time, s, until it had seen enough, divided by those of the tour.

        ``time_over_physical`` is the time divided by ``physical_seconds``.
        """
        tour = self.fastest
        path = {"path_over_oracle": metres / tour.metres} if tour.metres > 0 else {}
        over = {"time_over_oracle": seconds / tour.seconds, "time_over_physical": seconds / self.physical_seconds}
        return over | path


def _keyframes(
    stops: NDArray[np.float64], backwards: NDArray[np.bool_], first_heading: float, last_heading: float
) -> list[NDArray[np.float64]]:
    """Keyframe poses on the drives between stops (N, 2), and in the turns before and after each drive."""
    poses, heading = list[NDArray[np.float64]](), first_heading
    for (a, b), is_backwards in zip(pairwise(stops), backwards, strict=True):
        if (a != b).any():
            along = float(np.arctan2(b[1] - a[1], b[0] - a[0])) + np.pi * bool(is_backwards)
            poses += _keyframes_of_turn(a, heading, along) + _keyframes_of_line(a, b, along)
            heading = along
    return poses + _keyframes_of_turn(stops[-1], heading, last_heading)


def _keyframes_of_turn(
    place: NDArray[np.float64], first_heading: float, last_heading: float
) -> list[NDArray[np.float64]]:
    """Keyframe poses in a turn in place."""
    turn = float(wrap_angle(last_heading - first_heading))
    steps = np.arange(1, int(abs(turn) / KEYFRAME_SPACING.turn) + 1) * KEYFRAME_SPACING.turn * np.sign(turn)
    return [np.array([*place, first_heading + step]) for step in steps]


def _keyframes_of_line(a: NDArray[np.float64], b: NDArray[np.float64], heading: float) -> list[NDArray[np.float64]]:
    """Keyframe poses on a straight drive, including one at its end."""
    count = ceil(np.linalg.norm(b - a) / KEYFRAME_SPACING.distance)
    return [np.array([*place, heading]) for place in np.linspace(a, b, count + 1)[1:]]


def min_seconds(drives: Sequence[ViewpointDrive], drive_model: DriveModel) -> float:
    """Lower bound on the time that a robot needs for consecutive drives, s.

    An ideal driver turns while driving, so the bound is the longer of two times. The first is the time for all lines
    at maximum speed and acceleration, with stops only where the direction reverses. The second is the time for all
    turns at the maximum rate.
    """
    lines = [line for drive in drives for line in drive.lines]
    ways = [sum(way for way, *_ in run) for _, run in groupby(lines, key=lambda line: line[1])]
    driving = sum(_line_seconds(way, drive_model, stops=n < len(ways)) for n, way in enumerate(ways, 1))
    return max(driving, sum(drive.total_turn for drive in drives) / drive_model.top_turn_rate)


def _line_seconds(distance: float, drive_model: DriveModel, stops: bool) -> float:
    """Time, s, to drive ``distance``, m, from a standstill, and to a standstill if the robot ``stops`` at the end."""
    v, a, ends = drive_model.top_speed, drive_model.acceleration, 2 if stops else 1
    # Accelerating or braking takes v / a s, and covers half the distance that is covered at top speed in this time.
    if distance < ends * v**2 / (2 * a):
        return sqrt(2 * ends * distance / a)
    return distance / v + ends * v / (2 * a)
