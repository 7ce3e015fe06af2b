"""The whole pipeline (thesis, chapter 3): sense, map, decide where to go, plan, drive."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration.frontiers import find_frontiers
from pipeline.exploration.mission import PATIENCE, Mission
from pipeline.exploration.next_best_view import Exploration
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint
from pipeline.finds.reobservation import Reobservation
from pipeline.geometry.cells import centres
from pipeline.keyframes import Moves
from pipeline.labels import Label
from pipeline.localisation.localisation import KEYFRAME_WAY
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.keyframing import Keyframing
from pipeline.navigation.navigator import Navigator, Outcome
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.navigation.speed_limit import SpeedLimit
from pipeline.planning.path_plan import TOPOLOGICAL, PathPlan, Planner
from pipeline.planning.pose_paths import PosePaths
from pipeline.robot import Motion, Robot
from pipeline.transforms import yaw_of


@dataclass(frozen=True, eq=False)
class Step:
    """What a step has found out and decided.

    Attributes:
        keyframe: what was sensed, with its labels, planes and detections.
        context: what the decision was based on.
        viewpoint: where to go next; None if no viewpoint is left.
        plan: the way to the viewpoint.
        frontiers: (N, 3) centres of the frontiers left, m in ``map``.
        left: when exploring has ended, viewpoints that would show more but are not worth the drive.
        can_drive: whether the robot stands where it can drive and is not held.
        was_kidnapped: whether the robot was carried elsewhere since the last step.
    """

    keyframe: Keyframe
    context: Context
    viewpoint: Viewpoint | None
    plan: PathPlan | None
    frontiers: NDArray[np.float64]
    left: list[Viewpoint]
    can_drive: bool
    was_kidnapped: bool

    @property
    def traversability(self) -> Traversability:
        """Where the robot may drive."""
        return self.context.traversability


class Observer:
    """Watches an explorer; what a subclass does not override, it ignores."""

    def on_motion(self, motion: Motion) -> None:
        """The robot has moved for a control period."""

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """A keyframe is in the maps, in a step or during a drive."""

    def on_correction(self, moves: Moves) -> None:
        """The maps were made anew where the poses of their keyframes were corrected."""

    def on_step(self, explorer: "Explorer", step: Step) -> None:
        """A step is decided; the drive is yet to come."""

    def close(self) -> None:
        """The explorer has ended; write what is left."""


class Explorer:
    """Explores with a robot: each :meth:`step` renews the maps and the plan, each :meth:`drive` follows the plan.

    Attributes:
        robot: the body.
        mapper: all maps.
        mission: what to do next.
        navigator: drives the robot.
        keyframing: takes frames, also during a drive.
        steps: number of steps so far.
        observers: told of every event, in their order.
    """

    def __init__(
        self, robot: Robot, mapper: Mapper, exploration: Strategy | None = None, planner: Planner = TOPOLOGICAL
    ):
        """Begin where the robot stands, with the maps as they are; by default with the next best view."""
        self.robot, self.mapper = robot, mapper
        self.reobservation = Reobservation((mapper.victims, mapper.finds), mapper.metric_map, mapper.keyframes)
        exploration = exploration or Exploration(robot.model)
        if isinstance(exploration, Exploration) and exploration.takes_rewards:
            exploration.rewards = self.reobservation
        self.mission, self._planner = Mission(exploration), planner
        self.observers: list[Observer] = []
        self.navigator = Navigator(robot, on_motion=self._moved)
        self.keyframing = Keyframing(self.navigator, self.mapper, self._added)
        self.steps = 0
        self._failed_drives = 0

    def step(self) -> Step:
        """Sense, localise, map, decide where to go next and plan the way."""
        self.settle()
        frame = self.keyframing.sense()
        was_kidnapped = self.keyframing.pose_check.was_set_down(frame) and self.steps > 0
        keyframe = self.keyframing.add(frame, labelled=True)
        self.steps += 1
        self.reobservation.count(frame)
        with self.mapper.stopwatch("exploration"):
            viewpoint, context = self.decide(keyframe)
            frontiers = find_frontiers(context)
            has_ended = viewpoint is None and self.mission.goals is None and not self.is_held
            left = self.mission.left(context) if has_ended else []
        self.mapper.connect(keyframe, context.paths)
        with self.mapper.stopwatch("path_plan"):
            plan = self._plan(viewpoint, context) if viewpoint else None
        can_drive = context.paths.start is not None and not self.is_held
        step = Step(keyframe, context, viewpoint, plan, frontiers, left, can_drive, was_kidnapped)
        for observer in self.observers:
            observer.on_step(self, step)
        return step

    def redirect(self, step: Step, viewpoint: Viewpoint) -> Step:
        """The step, with a viewpoint that was chosen from outside and a plan that leads there, if a way does."""
        self.mission.exploration.commit(viewpoint, step.context)
        return replace(step, viewpoint=viewpoint, plan=self._plan(viewpoint, step.context))

    def drive(self, step: Step) -> bool:
        """Follow the plan of a step and turn to the viewpoint's heading; True if the robot got there.

        The robot stops before an obstacle that the map does not show: the next step plans anew.
        """
        if step.viewpoint is None or step.plan is None:
            return False
        T_map_start, viewpoint = step.keyframe.T_map_base, step.viewpoint
        check = ObstacleCheck(self.keyframing.returns, step.traversability, step.keyframe.frame.sensor)
        ramps = [centres(ramp.cells) for ramp in self.mapper.segments.of(Label.INCLINED_RAMP)]
        people = [victim.points for victim in self.mapper.victims.confirmed]
        with self.mapper.stopwatch("navigation"):
            reached = self.navigator.follow(
                step.plan.way_points[:, :2],
                viewpoint.heading if viewpoint.turn else None,
                step.plan.backwards,
                T_map_start[:2, 3],
                check.is_clear,
                SpeedLimit(step.traversability, ramps, people),
                self.keyframing.look,
            )
        T_map_base = self.navigator.T_map_base
        outcome = self.navigator.legs[-1].outcome
        was_kidnapped = outcome is Outcome.MOVED
        if outcome is Outcome.TILTED:
            self.keyframing.pose_check.doubt(self.navigator.halts[-1], step.traversability)
        assert self.navigator.motion is not None
        self.keyframing.pose_check.T_odom_expected = None if was_kidnapped else self.navigator.motion.T_odom_base
        came_away = np.linalg.norm(T_map_base[:2, 3] - T_map_start[:2, 3]) > KEYFRAME_WAY
        self._failed_drives = 0 if came_away else self._failed_drives + (not reached)
        self._learn_from_drive(check.obstacles)
        return reached

    def _moved(self, motion: Motion) -> None:
        for observer in self.observers:
            observer.on_motion(motion)

    def _added(self, keyframe: Keyframe) -> None:
        for observer in self.observers:
            observer.on_keyframe(keyframe)

    @property
    def T_map_start(self) -> NDArray[np.float64] | None:
        """4×4 pose at which the robot began; None before the first step."""
        return self.mapper.T_map_start

    @property
    def is_held(self) -> bool:
        """Whether ``PATIENCE`` drives failed since one last moved the robot by more than ``KEYFRAME_WAY``."""
        return self._failed_drives >= PATIENCE

    def decide(self, keyframe: Keyframe) -> tuple[Viewpoint | None, Context]:
        """The viewpoint to go to, None if there is none, and the context of the decision.

        If nothing leads to a goal, neither a way nor unseen ground, it is looked for again without the margin.
        """
        viewpoint, context = self._decide(keyframe)
        goals = self.mission.goals
        if viewpoint is None and goals is not None and goals.left and not (goals.is_tight or self.is_held):
            goals.is_tight = True
            return self._decide(keyframe)
        return viewpoint, context

    def _decide(self, keyframe: Keyframe) -> tuple[Viewpoint | None, Context]:
        T_map_base, goals = keyframe.T_map_base, self.mission.goals
        ground = self.mapper.traversability
        if goals is not None and goals.is_tight:
            ground = ground.without_margin
        # After failed drives clearance weighs more, so that the same way is not tried again.
        caution = 1.0 + self._failed_drives
        paths = PosePaths(ground, T_map_base[:2, 3], yaw_of(T_map_base), caution)
        poses = self.mapper.keyframes.poses
        context = Context(keyframe.frame, T_map_base, self.mapper.elevation_map.measured, paths, poses)
        self.mission.observe(context)
        choice = None if self.is_held else self.mission.next_viewpoint(context)
        if choice is None:
            return None, context
        strategy, viewpoint = choice
        strategy.commit(viewpoint, context)
        return viewpoint, context

    def _plan(self, viewpoint: Viewpoint, context: Context) -> PathPlan | None:
        heading = viewpoint.heading if viewpoint.turn else None
        return self._planner.plan(self.mapper.topological_map, context.paths, viewpoint.position, heading)

    def _learn_from_drive(self, obstacles: NDArray[np.float32]) -> None:
        """Pass obstacles (N, 3), the track of the drive and what the robot touched on to the mapper."""
        track = np.array(self.navigator.track).reshape(-1, 3)
        # If the robot did not get free, an obstacle mapped beside it would only shut it in.
        halts = [halt for halt in self.navigator.halts if halt.touches]
        self.mapper.add_drive(track, obstacles, [halt.touched(self.robot.model) for halt in halts])

    def settle(self) -> bool:
        """Correct the keyframes' poses, the maps and all places in them; True if any moved noticeably."""
        moves = self.mapper.settle()
        if moves is not None:
            for observer in self.observers:
                observer.on_correction(moves)
        self.navigator.correct(self.mapper.localisation.T_map_odom)
        return moves is not None
