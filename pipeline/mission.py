"""What a robot is sent for: it explores, drives to goals, drives home."""

from collections.abc import Iterator, Sequence
from typing import Any

from numpy.typing import ArrayLike

from pipeline.explorer import Explorer
from pipeline.goals import Goals
from pipeline.planning.path_plan import goal_name

HOME_SNAP = 0.5
"""m; so near to where it was set down a robot is home. It may have stood where it would not drive to."""


class Mission:
    """Sets an explorer's errands one after the other, and says what came of them."""

    def __init__(self, explorer: Explorer, goals: Sequence[ArrayLike] = (), home: bool = False):
        """``goals``: (2,) m in ``map``, to drive to after exploring; ``home``: whether to come back at the end."""
        self._explorer, self._wanted, self._home = explorer, goals, home
        self._visited: dict[str, Goals] = {}
        self._told: dict[str, int] = {}

    def __iter__(self) -> Iterator[str]:
        """The name of each errand, when the explorer has been sent for it; the first is to explore."""
        self._explorer.goals = None
        yield "exploring"
        if self._wanted:
            yield from self._send("goals", Goals(self._explorer.topological_map, self._wanted))
        if self._home and self._explorer.T_map_start is not None:
            start = self._explorer.T_map_start[:2, 3]
            yield from self._send("home", Goals(self._explorer.topological_map, [start], HOME_SNAP))

    def _send(self, name: str, goals: Goals) -> Iterator[str]:
        self._explorer.goals = self._visited[name] = goals
        yield name
        goals.refuse("the robot is held where it stands" if self._explorer.is_held else None)

    def news(self) -> Iterator[tuple[str, bool]]:
        """Lines on what came of goals since the last call, and whether that is good."""
        for name, goals in self._visited.items():
            for visit in goals.visits[self._told.get(name, 0) :]:
                place = "home" if name == "home" else goal_name(visit.goal)
                yield visit.obstacle or f"{place} is reached", visit.obstacle is None
            self._told[name] = len(goals.visits)

    def report(self) -> dict[str, Any]:
        """Figures of each errand that the robot was sent for after exploring, and why goals were not reached."""
        return {
            name: {
                "given": len(goals.visits) + len(goals.left),
                "reached": sum(visit.obstacle is None for visit in goals.visits),
                "refused": [visit.obstacle for visit in goals.visits if visit.obstacle],
            }
            for name, goals in self._visited.items()
        }
