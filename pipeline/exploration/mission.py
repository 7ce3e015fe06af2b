"""Missions: an ordered list of strategies that share one context (explore, drive to goals, drive home)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Place, Pose
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.errors import required
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.deadline import Deadline
from pipeline.exploration.unseen_ways import PathView, UnseenGroundSearch
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint
from pipeline.planning.path_plan import goal_name, order_goals, unreachable_reason
from pipeline.planning.pose_paths import PosePaths


class RobotState(Protocol):
    """The part of a robot's state that a mission needs."""

    @property
    def T_map_start(self) -> Pose | None:
        """Pose at which the robot started; None if it has not started."""
        ...

    @property
    def is_held(self) -> bool:
        """Whether the robot cannot drive away from its position."""
        ...


class Mission:
    """Chooses the next viewpoint: the first that a strategy returns, in the order of :attr:`strategies`.

    A mission begins with exploration; :meth:`tasks` sends the robot to goals and home afterwards.

    Attributes:
        exploration: the strategy that explores unseen ground.
        goals: the goals of the current task; None while the task is to explore.
        may_explore: whether exploration may continue.
        deadline: the running clock; None without a time limit.
        inspection: the strategy used when nothing is left to explore; None if there is none.
    """

    def __init__(self, exploration: Strategy, *, config: ExplorationConfig = ExplorationConfig()):
        """Begin with the strategy ``exploration``."""
        self.exploration, self._config = exploration, config
        self.goals: Goals | None = None
        self.may_explore = True
        self.deadline: Deadline | None = None
        self.inspection: Strategy | None = None
        self._active_strategy: Strategy | None = exploration
        self._is_on_retreat = False
        self._visited: dict[str, Goals] = {}
        self._reported: dict[str, int] = {}

    @property
    def strategies(self) -> Iterator[Strategy]:
        """The strategies in order of precedence.

        If there are goals, they come first, followed by exploration if it may open a path to them. Otherwise,
        exploration comes first, followed by inspection.
        """
        if self.goals is not None:
            yield self.goals
        if self.may_explore if self.goals is None else self.goals.may_open:
            yield self.exploration
        if self.goals is None and self.may_explore and self.inspection is not None:
            yield self.inspection

    def observe(self, context: Context) -> None:
        """Let every strategy take the newest keyframe into account."""
        self.exploration.observe(context)
        if self.inspection is not None:
            self.inspection.observe(context)
        if self.goals is not None:
            self.goals.observe(context)
        if self.deadline is not None:
            self.deadline.observe(context)

    @property
    def explores(self) -> bool:
        """Whether the current task is to explore."""
        return self.goals is None

    @property
    def is_out_of_time(self) -> bool:
        """Whether the last viewpoint was refused because the robot has to turn back."""
        return self.deadline is not None and self.deadline.has_refused

    @property
    def ignores_margin(self) -> bool:
        """Whether paths to the current goals are planned without a margin."""
        return self.goals is not None and self.goals.ignores_margin

    def tighten(self) -> bool:
        """Plan paths to the current goals without a margin; False if this is so already, or if no goal is left."""
        if self.goals is None or not self.goals.remaining or self.goals.ignores_margin:
            return False
        self.goals.ignores_margin = True
        return True

    def choose(self, context: Context) -> Viewpoint | None:
        """The first viewpoint that a strategy returns; the robot then sets out for it.

        None if the task is done, or if the clock does not allow the drive.
        """
        for strategy in self.strategies:
            if (viewpoint := strategy.next_viewpoint(context)) is not None:
                if not self._has_time(viewpoint, context):
                    return None
                strategy.commit(viewpoint, context)
                self._active_strategy = strategy
                return viewpoint
        return None

    def set_out_without_strategy(self) -> None:
        """Begin a drive that no strategy has chosen; no strategy may end it early, and the clock ignores it."""
        self._active_strategy = None
        if self.deadline is not None:
            self.deadline.set_out_unplanned()

    def is_shown(self, elevation_map: ElevationMap) -> bool:
        """Whether the drive to the last viewpoint has already shown the ground that the robot set out to see."""
        has_answer = hasattr(self._active_strategy, "is_shown")  # A user's own strategy may lack this method
        return has_answer and required(self._active_strategy).is_shown(elevation_map)

    def _has_time(self, viewpoint: Viewpoint, context: Context) -> bool:
        """Whether the clock allows the drive; if so, the start of the drive is recorded.

        On the retreat, the clock is ignored.
        """
        if self.deadline is None:
            return True
        if not self._is_on_retreat and not self.deadline.allows(viewpoint.position, context):
            return False
        self.deadline.set_out(viewpoint.position, context)
        return True

    def leftovers(self, context: Context) -> list[Viewpoint]:
        """Viewpoints for the ground that exploration has given up, see :meth:`Strategy.leftovers`."""
        has_answer = hasattr(self.exploration, "leftovers")  # A user's own strategy may lack this method
        return self.exploration.leftovers(context) if has_answer else []

    def tasks(
        self, goals: Sequence[ArrayLike], home: bool, robot: RobotState, explores: bool = True
    ) -> Iterator[str]:
        """Begin one task after another: explore if ``explores``, drive to ``goals``, and drive home if ``home``.

        Goals are (2,) positions in ``map``, m. If :attr:`deadline` has a retreat, the last drive leads there instead
        of home.

        Yields:
            The name of each task as it begins; the caller then makes steps until a step has no plan.
        """
        if explores:
            yield "exploring"
        if goals:
            yield from self._visit("goals", self._goals(goals), robot)
        if self.deadline is not None and self.deadline.retreat is not None:
            retreat, self._is_on_retreat = self.deadline.retreat, True
            yield from self._visit(retreat.task, self._goals([retreat.position], may_be_near=True), robot)
        elif home and robot.T_map_start is not None:
            yield from self._visit("home", self._goals([robot.T_map_start[:2, 3]], may_be_near=True), robot)

    def _goals(self, goals: Sequence[ArrayLike], may_be_near: bool = False) -> "Goals":
        return Goals(goals, may_be_near, config=self._config)

    def _visit(self, name: str, goals: "Goals", robot: RobotState) -> Iterator[str]:
        self.goals = self._visited[name] = goals
        if self.deadline is not None:
            self.deadline.has_refused = False  # it may have ended the previous task
        yield name
        if self.is_out_of_time:
            goals.refuse("too little time was left before the drive back")
        goals.refuse("the robot was stuck" if robot.is_held else None)

    def new_outcomes(self) -> Iterator[tuple[str, bool]]:
        """Yield a line for each goal visited or given up since the last call, and whether the goal was reached."""
        for name, goals in self._visited.items():
            for visit in goals.visits[self._reported.get(name, 0) :]:
                place = "home" if name == "home" else goal_name(visit.goal)
                yield visit.failure_reason or f"reached {place}", visit.failure_reason is None
            self._reported[name] = len(goals.visits)

    def report(self) -> dict[str, Any]:
        """Figures of each task after exploration, and the reasons why goals were not reached."""
        return {
            name: {
                "given": len(goals.visits) + len(goals.remaining),
                "reached": sum(visit.failure_reason is None for visit in goals.visits),
                "refused": [visit.failure_reason for visit in goals.visits if visit.failure_reason],
                "each": [{"way_m": visit.distance, "time_s": visit.end - visit.begin} for visit in goals.visits],
            }
            for name, goals in self._visited.items()
        }

    @property
    def visits(self) -> dict[str, list["Visit"]]:
        """The outcomes of goals so far, by task name."""
        return {name: goals.visits for name, goals in self._visited.items()}


@dataclass(frozen=True, eq=False)
class Visit:
    """The outcome of the drives to a goal.

    Attributes:
        goal: (2,) m, position of the goal in ``map``.
        failure_reason: why the robot did not reach it, as a line for the log; None if it did.
        distance: distance driven by odometry towards this goal, m.
        begin: the robot's time at the end of the previous visit or, without one, at the start of the task, s.
        end: the robot's time at the end of this visit, s.
    """

    goal: Place
    failure_reason: str | None
    distance: float
    begin: float
    end: float


class Goals(Strategy):
    """Drives to goals, even through unseen ground, in an order that keeps the drive short, updated at every step.

    Attributes:
        remaining: goals still to be visited, each (2,) m in ``map``.
        visits: outcomes of the other goals, in the order in which they were visited or given up.
        ignores_margin: whether paths to the goals need no margin, see :attr:`Traversability.without_margin`; set once
            no other path is left.
    """

    def __init__(
        self,
        goals: Sequence[ArrayLike],
        may_be_near: bool = False,
        *,
        config: ExplorationConfig = ExplorationConfig(),
    ):
        """Start with goals, each a (2,) position in ``map``, m.

        ``may_be_near``: whether the nearest reachable ground within the robot's length may replace a goal, such as
        the start, which may not be reachable itself.
        """
        self.remaining = [np.asarray(goal, np.float64) for goal in goals]
        self.visits: list[Visit] = []
        self.ignores_margin = False
        self._may_be_near, self._config = may_be_near, config
        self._context: Context | None = None
        self._since: Context | None = None  # context at the start of the drive to the next goal
        self._goal: Place | None = None
        self._unseen: UnseenGroundSearch | None = None
        self._view: PathView | None = None
        # By ``id`` of a goal: lowest cost of a path to it so far, s, and number of drives without progress since.
        self._tries: dict[int, tuple[float, int]] = {}

    def observe(self, context: Context) -> None:
        """Count goals that the robot has reached, and give up a goal if drives bring the robot no nearer to it."""
        self._context, self._since = context, self._since or context
        for goal in list(self.remaining):
            place = self._drive_target(goal, context.paths)
            if np.linalg.norm(place - context.T_map_base[:2, 3]) <= self._config.goal_tolerance:
                self._record_visit(goal, None)
            elif goal is self._goal and self._is_hopeless(goal, context.paths.cost_to(place)):
                drives = self._config.max_drives_without_progress
                self._record_visit(
                    goal, f"{goal_name(goal)} was given up: {drives} drives brought the robot no nearer"
                )
        self._goal = self._view = None
        if any(unreachable_reason(context.paths, self._drive_target(goal, context.paths)) for goal in self.remaining):
            self._unseen = self._unseen or UnseenGroundSearch(context.traversability.robot, self._config)
            self._unseen.observe(context)

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The next goal, or a view of unseen ground on the path to it; None if no path to any goal is left."""
        places = [self._drive_target(goal, context.paths) for goal in self.remaining]
        are_known = all(unreachable_reason(context.paths, place) is None for place in places)
        order = order_goals(context.paths, places) if are_known else self._order_through_unseen(places, context)
        for place in (places[k] for k in order):
            if unreachable_reason(context.paths, place) is None:
                way = place - context.T_map_base[:2, 3]
                return Viewpoint(place, float(np.arctan2(way[1], way[0])), turn=False, gain=0.0)
            if (view := required(self._unseen).view_towards(place, context)) is not None:
                return view
        return None

    def _order_through_unseen(self, places: list[Place], context: Context) -> list[int]:
        """Indices of the places that can be reached if unseen ground is free, in the order in which to visit them."""
        unseen = required(self._unseen)
        near = [
            k
            for k, place in enumerate(places)
            if not unseen.is_far(place, context) or unreachable_reason(context.paths, place) is None
        ]
        if context.paths.start is None or len(near) < 2:
            return near
        ground = unseen.ground_towards(np.array([places[k] for k in near]), context)
        paths = PosePaths(ground, context.paths.start, context.paths.heading, context.paths.caution)
        return [near[k] for k in order_goals(paths, [places[k] for k in near])]

    @property
    def may_open(self) -> bool:
        """Whether exploration may open a path to a remaining goal, because hazards alone do not block all paths.

        False while paths to the goals are still planned with a margin.
        """
        unseen, context = self._unseen, self._context
        if unseen is None or context is None or not self.ignores_margin:
            return False
        return any(unseen.may_open(self._drive_target(goal, context.paths), context) for goal in self.remaining)

    def is_shown(self, elevation_map: ElevationMap) -> bool:
        """Whether the map now shows the ground that the robot set out to see."""
        return self._view is not None and self._unseen is not None and self._unseen.is_shown(elevation_map)

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember the goal for which the robot sets out, or the ground that it sets out to see."""
        if isinstance(viewpoint, PathView) and self._unseen is not None:
            self._view = viewpoint
            self._unseen.commit(viewpoint, context)
            return
        self._goal = next(
            g for g in self.remaining if (self._drive_target(g, context.paths) == viewpoint.position).all()
        )
        self._tries.setdefault(id(self._goal), (context.paths.cost_to(viewpoint.position), 0))

    def refuse(self, why: str | None = None) -> None:
        """Give up the remaining goals; ``why``: the reason, by default why no path led to them in the last step."""
        for goal in list(self.remaining):
            reason = self._unreachable_reason(goal) if why is None else None
            self._record_visit(goal, reason or f"{goal_name(goal)} was not reached: {why or 'the episode ended'}")

    def _unreachable_reason(self, goal: Place) -> str | None:
        """The reason, as a line for the log, why no path leads to a goal; None if a path may lead there."""
        context, unseen = self._context, self._unseen
        if context is None or unseen is None:
            return None
        place = self._drive_target(goal, context.paths)
        known = unreachable_reason(context.paths, place)
        if known is None or unseen.view_towards(place, context) is not None:
            return None
        return unseen.unreachable_reason(place, context) or known

    def _drive_target(self, goal: Place, paths: PosePaths) -> Place:
        """The position to which the robot drives for a goal: the nearest reachable one close to it, or the goal."""
        if not np.isfinite(goal).all():
            return goal
        t = paths.traversability
        place = t.grid.nearest(paths.reachable, goal, t.robot.length if self._may_be_near else 0.0)
        return goal if place is None else place

    def _is_hopeless(self, goal: Place, seconds_left: float) -> bool:
        """Whether the ``max_drives_without_progress`` latest drives to a goal brought the robot no nearer to it."""
        shortest, drives = self._tries[id(goal)]
        is_nearer = seconds_left < shortest - self._config.min_progress
        self._tries[id(goal)] = (seconds_left, 0) if is_nearer else (shortest, drives + 1)
        return self._tries[id(goal)][1] >= self._config.max_drives_without_progress

    def _record_visit(self, goal: Place, failure_reason: str | None) -> None:
        self.remaining = [other for other in self.remaining if other is not goal]
        begin, end = self._since, self._context
        if begin is None or end is None:
            self.visits.append(Visit(goal, failure_reason, 0.0, 0.0, 0.0))
            return
        way, times = end.driven - begin.driven, (begin.frame.time, end.frame.time)
        self.visits.append(Visit(goal, failure_reason, way, *times))
        self._since = end
