"""The clock of a mission: when the robot must turn back, and where it must be at the end."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from pipeline.arrays import Place, Places
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.viewpoint import Context
from pipeline.planning.pose_paths import PosePaths


class TimeIsUpError(Exception):
    """The mission's time is up."""


class PlacedFind(Protocol):
    """The properties of a find that a mission needs."""

    @property
    def kind(self) -> str:
        """Kind of the find."""
        ...

    @property
    def position(self) -> Place:
        """(3,) m, position of the find in ``map``."""
        ...


@dataclass(frozen=True, eq=False)
class Retreat:
    """The position at which a mission must end.

    Attributes:
        task: ``home``, at the robot's start, or ``park``, near living victims.
        position: (2,) m, position in ``map``.
    """

    task: Literal["home", "park"]
    position: Place


class Deadline:
    """Compares the remaining time with the time of the drive to the position where the mission must end.

    Attributes:
        begin: the robot's time at which the clock started, s.
        end: the robot's time at which the clock stops, s.
        retreat: position where the robot must be at ``end``; None if it may be anywhere.
        has_refused: whether the last viewpoint was refused because the robot has to turn back.
    """

    def __init__(
        self,
        begin: float,
        end: float,
        finds: Callable[[], Iterable[PlacedFind]],
        home: bool = False,
        max_victim_distance: float | None = None,
        *,
        config: ExplorationConfig = ExplorationConfig(),
    ):
        """Start the clock.

        Args:
            begin, end: times of the robot at which the clock starts and stops, s.
            finds: returns the finds so far.
            home: whether the robot must be back at its start at ``end``.
            max_victim_distance: maximum distance to living victims at ``end``, if any were found, m; None for no
                limit.
            config: settings of exploration.
        """
        self.end = end
        self.retreat: Retreat | None = None
        self.has_refused = False
        self.begin, self._finds, self._wants_home = begin, finds, home
        # The robot may stop ``goal_tolerance`` m short of a position, because the position then counts as reached.
        self._goal_tolerance = config.goal_tolerance
        self._max_victim_distance = (
            None if max_victim_distance is None else max_victim_distance - self._goal_tolerance
        )
        self._home: Place | None = None
        # Planned and actual time of all drives, and the longest delay so far, s.
        self._planned, self._taken, self._max_delay = 0.0, 0.0, 0.0
        # Start and planned time of the last drive, s; None if it has no planned time.
        self._last: tuple[float, float] | None = (begin, 0.0)

    def observe(self, context: Context) -> None:
        """Update the retreat, and record how much longer than planned the last drive took."""
        if self._home is None:
            self._home = context.T_map_base[:2, 3].copy()
        if self._last is not None:
            begin, seconds = self._last
            taken = context.frame.time - begin
            self._max_delay = max(self._max_delay, taken - seconds)
            self._taken += taken if seconds else 0.0  # turns in place do not show how fast the robot drives
        self._last = context.frame.time, 0.0
        place = None
        if self._max_victim_distance is not None:
            victims = [find.position[:2] for find in self._finds() if find.kind == "heat"]
            place = parking_place(np.array(victims).reshape(-1, 2), context.paths, self._max_victim_distance)
        if place is not None:
            self.retreat = Retreat("park", place)
        elif self._wants_home:
            self.retreat = Retreat("home", self._home)

    def allows(self, position: Place, context: Context) -> bool:
        """Whether a drive to a position (2,) leaves time for the drive from there to the retreat.

        Planned times are multiplied by the ratio of actual to planned times so far, if above 1, and the longest delay
        so far is added as a margin. If the map shows no path to the retreat, the drive there is assumed to take as
        long as the run so far plus the drive to the position.
        """
        now = context.frame.time
        if self.retreat is None:
            return True
        under_way = now - self.begin
        there = _finite_or(context.paths.without_risk.cost_to(position), 0.0)
        ways = PosePaths(context.traversability, self.retreat.position, caution=0.0)
        back = under_way + there if ways.start is None else _finite_or(ways.cost_to(position), under_way + there)
        slowness = max(1.0, self._taken / self._planned) if self._planned else 1.0
        can_do = now + slowness * (there + back) + self._max_delay <= self.end
        self.has_refused = not can_do
        return can_do

    def set_out(self, position: Place, context: Context) -> None:
        """Remember the planned time of a drive to a position (2,)."""
        is_drive = np.linalg.norm(position - context.T_map_base[:2, 3]) > self._goal_tolerance
        seconds = _finite_or(context.paths.without_risk.cost_to(position), 0.0) if is_drive else 0.0
        self._planned += seconds
        self._last = context.frame.time, seconds

    def set_out_unplanned(self) -> None:
        """Begin a drive that has no planned time and therefore cannot be late."""
        self._last = None


def _finite_or(seconds: float, otherwise: float) -> float:
    return seconds if np.isfinite(seconds) else otherwise


def parking_place(victims: Places, paths: PosePaths, near: float) -> Place | None:
    """Of the positions with the most victims (N, 2) within ``near`` m, the cheapest to reach; None without any."""
    if not len(victims) or paths.start is None:
        return None
    grid = paths.traversability.grid
    cells = np.argwhere(paths.reachable)
    places = grid.centre_of(cells)
    count = (np.linalg.norm(places[:, None] - victims, axis=2) <= near).sum(axis=1)
    if not count.any():
        return None
    best = np.flatnonzero(count == count.max())
    cost = paths.cost[tuple(cells[best].T)]
    return np.asarray(places[best[cost.argmin()]], np.float64)
