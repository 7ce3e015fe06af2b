"""The robot's paths from the entrance to people, with directions and with the drops next to each path."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import radians, sqrt

import numpy as np
from scipy.spatial import KDTree

from pipeline.arrays import Cells, Place, Places, Points
from pipeline.elevation_map.traversability import Traversability
from pipeline.errors import required
from pipeline.labels import RAMP_TILT
from pipeline.metric_map.metric_map import MetricMap
from pipeline.planning.path_plan import plan_path
from pipeline.planning.pose_paths import PosePaths
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.ground import Hazards, ReportedPlace, places
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.transforms import wrap_angle

MAX_CHECKED_VIEWS = 400
"""Maximum number of cells whose view of a person is checked; cells far from the person are checked more sparsely."""
MIN_BEND = radians(20)
"""Change of direction above which a new straight part of a path begins, rad."""
MIN_LEG_LENGTH = 0.2
"""Length below which a straight part of a path is described together with the next one, m."""


@dataclass(frozen=True)
class RouteLeg:
    """A straight part of a path.

    Attributes:
        turn: turn to the left at the start of the part, relative to the previous heading, rad.
        length: length along the ground, m.
        steepest: maximum inclination of the ground under the part, rad.
        is_steep: whether the part leads over a slope.
    """

    turn: float
    length: float
    steepest: float
    is_steep: bool


@dataclass(frozen=True, eq=False)
class Route:
    """A path to a reachable position close to a person, in sight of the person if possible.

    Attributes:
        waypoints: (N, 3) m, bends of the path, start and end included.
        trace: the same path with points on the ground between the bends, at most a cell apart.
        drops: drops next to the path, the deepest first, with their depth, m.
        distance_to_person: horizontal distance from the end of the path to the nearest of the person's points, m.
        is_in_sight: whether the robot's map shows no obstacle between the end of the path and the person.
        arrives: whether the path ends next to the person.
        legs: straight parts of the path, for directions.
        heading: heading at the end of the last leg, rad.
    """

    waypoints: Places
    trace: Places
    drops: list[ReportedPlace]
    distance_to_person: float
    is_in_sight: bool
    arrives: bool
    legs: list[RouteLeg]
    heading: float

    @property
    def end(self) -> Place:
        """x and y of the end of the path."""
        return self.waypoints[-1, :2]

    @property
    def length(self) -> float:
        """Length of the path along the ground, m."""
        return sum(leg.length for leg in self.legs)

    @property
    def steepest(self) -> float:
        """Maximum inclination of the ground under the path, rad."""
        return max((leg.steepest for leg in self.legs), default=0.0)


@dataclass(frozen=True, eq=False)
class Router:
    """Finds paths from the entrance to people with the robot's own maps.

    Attributes:
        paths: cheapest paths from the entrance.
        topology: the topological map.
        metric_map: metric map in which lines of sight to a person are checked.
        hazards: hazards on the ground; drops within the robot's length of a route are reported with the route.
        heading: heading at the entrance, rad.
        camera_height: height of the camera above the ground, m.
        config: parameters of the report.
    """

    paths: PosePaths
    topology: TopologicalMap
    metric_map: MetricMap
    hazards: Hazards
    heading: float
    camera_height: float
    config: RescueReportConfig

    @property
    def _traversability(self) -> Traversability:
        return self.paths.traversability

    @cached_property
    def _cells(self) -> Cells:
        return np.argwhere(self.paths.reachable)

    def to(self, points: Points) -> Route | None:
        """The route to the person with these points; None if the robot cannot leave the entrance."""
        if not len(self._cells):
            return None
        # Cells are ranked by their distance from the person, in rings two cells wide, and within a ring by path cost.
        grid = self._traversability.grid
        centres = grid.centre_of(self._cells)
        gaps, _ = KDTree(points[:, :2]).query(centres)
        order = np.lexsort((self.paths.cost[tuple(self._cells.T)], np.ceil(gaps / (2 * grid.cell))))
        # The path ends at the first checked cell in sight of the person, or else at the first of all cells.
        person = KDTree(points)
        checked = order[np.unique(np.geomspace(1, len(order), MAX_CHECKED_VIEWS).astype(int)) - 1]
        seeing = next((k for k in checked if self._sees(centres[k], person)), None)
        end = order[0] if seeing is None else seeing
        plan = required(plan_path(self.topology, self.paths, centres[end]))
        waypoints = np.vstack([self._traversability.on_ground(required(self.paths.start)[None]), plan.waypoints])
        ends = pairwise(waypoints[:, :2])
        parts = [np.linspace(a, b, 1 + int(np.ceil(np.linalg.norm(b - a) / grid.cell))) for a, b in ends]
        trace = self._traversability.on_ground(np.vstack(parts))
        legs, heading = self._directions(waypoints)
        return Route(
            waypoints=waypoints,
            trace=trace,
            drops=self._drops_beside(trace),
            distance_to_person=float(gaps[end]),
            is_in_sight=seeing is not None,
            arrives=seeing is not None and float(gaps[end]) <= self.config.arrival,
            legs=legs,
            heading=heading,
        )

    def _sees(self, place: Place, person: KDTree) -> bool:
        """Whether the metric map shows no obstacle between the camera at a position and the centre of a person."""
        ground = float(self._traversability.grid.at(self._traversability.elevation, place))
        eye = np.append(place, ground + self.camera_height)
        middle = person.data.mean(axis=0)
        # Voxels within a diagonal of the person's points do not block the view.
        is_heat_of_person = self.metric_map.voxel_size * sqrt(3)
        return bool(
            self.metric_map.are_sightlines_free(eye[None], middle, person, is_heat_of_person, may_be_unknown=True)[0]
        )

    def _directions(self, path: Places) -> tuple[list[RouteLeg], float]:
        """The legs of a path, and the heading at the end of the last leg, rad."""
        legs, heading = list[RouteLeg](), self.heading
        for line, points in described_parts(path[:, :2]):
            first, last = _bearings(line)
            length, steepest = self._measure(points)
            legs.append(RouteLeg(wrap_angle(first - heading), length, steepest, steepest > RAMP_TILT))
            heading = last
        return legs, heading

    def _measure(self, points: Places) -> tuple[float, float]:
        """Length along the ground, m, and maximum inclination, rad, of a path through (N, 2) points."""
        grid = self._traversability.grid
        gradient = self._traversability.gradient
        length = 0.0
        steepest = 0.0
        for a, b in pairwise(points):
            level = float(np.linalg.norm(b - a))
            steps = max(1, int(np.ceil(2 * level / grid.cell)))
            middles = a + (np.arange(steps)[:, None] + 0.5) / steps * (b - a)
            rise = grid.at(gradient[..., 0], middles) * (b - a)[0]
            rise = rise + grid.at(gradient[..., 1], middles) * (b - a)[1]
            length += float(np.hypot(level, rise).mean())
            steepest = max(steepest, float(grid.at(self.hazards.slope, middles).max()))
        return length, steepest

    def _drops_beside(self, trace: Places) -> list[ReportedPlace]:
        """Drops within the robot's length of a path; drops closer together than the robot's width form one place."""
        grid = self._traversability.grid
        robot = self._traversability.robot
        edges = np.argwhere(self.hazards.drop > 0)
        if not len(edges):
            return []
        near = KDTree(trace[:, :2]).query(grid.centre_of(edges))[0] <= robot.length
        beside = np.zeros(grid.shape, np.bool_)
        beside[tuple(edges[near].T)] = True
        return places(grid, beside, self.hazards.drop, robot.width)


def described_parts(path: Places) -> list[tuple[Places, Places]]:
    """The straight parts of a path, none shorter than ``MIN_LEG_LENGTH`` unless the whole path is shorter.

    A shorter part is joined to the next one or, at the end of the path, to the last one. Parts without a bend between
    them are joined as well.

    Returns:
        For each part, a line whose first and last segments have the part's direction, and all points of the part.
    """
    told = list[tuple[Places, Places]]()
    short = path[:0]
    for part in straight_parts(path, MIN_BEND):
        short = np.vstack([short, part])
        if _length(short) >= MIN_LEG_LENGTH:
            line = part if _length(part) >= MIN_LEG_LENGTH else short[[0, -1]]
            if told and abs(wrap_angle(_bearings(line)[0] - _bearings(told[-1][0])[1])) <= MIN_BEND:
                before, points = told.pop()
                line, short = np.vstack([before, line]), np.vstack([points, short])
            told.append((line, short))
            short = path[:0]
    if len(short):
        line, points = told.pop() if told else (short[[0, -1]], short[:0])
        told.append((line, np.vstack([points, short])))
    return told


def _length(path: Places) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _bearings(line: Places) -> tuple[float, float]:
    """Directions of the first and last segments of a line, rad."""
    first, last = np.arctan2(*np.diff(line, axis=0)[[0, -1]].T[::-1]).tolist()
    return first, last


def straight_parts(path: Places, bend: float) -> Iterator[Places]:
    """The parts of a path between bends of more than ``bend`` rad."""
    steps = np.diff(path, axis=0)
    path = path[np.append(True, np.linalg.norm(steps, axis=1) > 0)]
    bearings = np.arctan2(*np.diff(path, axis=0).T[::-1])
    bends = 1 + np.flatnonzero(np.abs(wrap_angle(np.diff(bearings))) > bend)
    for a, b in pairwise([0, *bends.tolist(), len(path) - 1]):
        if b > a:
            yield path[a : b + 1]
