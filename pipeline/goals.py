"""Driving to places that somebody wants the robot at, in place of exploring."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.exploration.next_best_view import Viewpoint
from pipeline.planning.path_plan import goal_name, obstacle_to, order_goals
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability

ARRIVED = 0.15
"""m; a robot so near to a goal has reached it."""
PROGRESS = 0.1
"""m by which the way to a goal must have become shorter, or the drive was in vain."""
PATIENCE = 5
"""Drives in vain after which a goal is given up."""


@dataclass(frozen=True, eq=False)
class Visit:
    """What came of a goal.

    Attributes:
        goal: (2,) m in ``map``.
        obstacle: why the robot did not reach it, in a line for the log; None if it did.
    """

    goal: NDArray[np.float64]
    obstacle: str | None


class Goals:
    """Chooses goals in the order that makes the drive short, renewed with every look.

    Attributes:
        left: (2,) each, those still to be visited.
        visits: what came of the others, in the order in which that was clear.
    """

    def __init__(self, topology: TopologicalMap, goals: Sequence[ArrayLike], snap: float = 0.0):
        """Begin with all goals (2,), m in ``map``.

        Args:
            topology: tells how long the drives between them take.
            goals: where to go.
            snap: m by which a goal may be off where the robot can drive; the nearest such place serves as well.
        """
        self.left = [np.asarray(goal, np.float64) for goal in goals]
        self.visits: list[Visit] = []
        self._topology, self._snap = topology, snap
        self._obstacles: list[str | None] = []
        self._goal: NDArray[np.float64] | None = None
        self._way_left, self._in_vain = np.inf, 0

    def next_viewpoint(
        self,
        traversability: Traversability,
        measured: NDArray[np.float32],
        paths: ShortestPaths,
        T_map_base: NDArray[np.float64],
    ) -> Viewpoint | None:
        """The next goal; None when none is left that can be reached as far as the map goes."""
        here = T_map_base[:2, 3]
        for goal in list(self.left):
            if np.linalg.norm(self._place(goal, traversability) - here) <= ARRIVED:
                self._end(goal, None)
        while order := order_goals(self._topology, traversability, paths, self._places(traversability)):
            goal, place = self.left[order[0]], self._places(traversability)[order[0]]
            if self._is_worth_a_try(goal, paths.cost_to(place)):
                way = place - here
                return Viewpoint(place, float(np.arctan2(way[1], way[0])), turn=False, gain=0.0)
            self._end(goal, f"{goal_name(goal)} is given up: {PATIENCE} drives brought the robot no nearer")
        self._obstacles = [obstacle_to(traversability, paths, goal) for goal in self.left]
        return None

    def refuse(self, why: str | None = None) -> None:
        """Give up those that are left, because of what the last look showed if nobody says ``why``."""
        reasons = dict(enumerate([] if why else self._obstacles))
        for k, goal in enumerate(self.left):
            self._end(
                goal, reasons.get(k) or f"{goal_name(goal)} was not reached: {why or 'the episode ended'}"
            )

    def _places(self, traversability: Traversability) -> list[NDArray[np.float64]]:
        return [self._place(goal, traversability) for goal in self.left]

    def _place(self, goal: NDArray[np.float64], traversability: Traversability) -> NDArray[np.float64]:
        """(2,) where to drive to for a goal."""
        place = (
            traversability.grid.nearest(traversability.traversable, goal, self._snap)
            if np.isfinite(goal).all()
            else None
        )
        return goal if place is None else place

    def _is_worth_a_try(self, goal: NDArray[np.float64], way_left: float) -> bool:
        """Whether the drives to this goal still lead somewhere."""
        if goal is not self._goal:
            self._goal, self._way_left, self._in_vain = goal, np.inf, 0
        if way_left < self._way_left - PROGRESS:
            self._way_left, self._in_vain = way_left, 0
        else:
            self._in_vain += 1
        return self._in_vain < PATIENCE

    def _end(self, goal: NDArray[np.float64], obstacle: str | None) -> None:
        self.left = [other for other in self.left if other is not goal]
        self.visits.append(Visit(goal, obstacle))
