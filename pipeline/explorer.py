"""The whole pipeline (thesis, chapter 3): sense, localise, map, decide where to go, plan, drive."""

from dataclasses import replace

import numpy as np

from pipeline.arrays import Place, Places, Points, Pose
from pipeline.exploration.frontiers import find_frontiers
from pipeline.exploration.mission import Mission
from pipeline.exploration.next_best_view import NextBestView
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint, ViewpointRewards
from pipeline.labels import Label
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.commands import Outcome
from pipeline.navigation.course import Course
from pipeline.navigation.navigator import Navigator
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.navigation.speed_limit import SpeedLimit
from pipeline.pilot import Pilot
from pipeline.planning.path_plan import TOPOLOGICAL, PathPlan, Planner
from pipeline.planning.pose_paths import PosePaths
from pipeline.planning.stretches import Stretch, stretches_of
from pipeline.robot import Robot
from pipeline.sink import Sink, Step
from pipeline.tracks.reobservation import Reobservation


class Explorer:
    """Explores with a robot: :meth:`step` updates the maps and the plan, :meth:`drive` follows the plan.

    Attributes:
        mapper: holds all maps.
        mission: decides what to do next.
        pilot: moves the robot.
        steps: number of steps so far.
    """

    def __init__(
        self,
        robot: Robot,
        mapper: Mapper,
        exploration: Strategy | None = None,
        planner: Planner = TOPOLOGICAL,
        navigator: Navigator | None = None,
    ):
        """Start at the robot's current position with the mapper's maps; the default strategy is the next best view.

        ``navigator``: follows paths; by default one that commands velocities.
        """
        self.mapper = mapper
        self.reobservation = Reobservation(
            (mapper.victims, mapper.finds), mapper.metric_map, mapper.keyframes, mapper.config.tracks.reobservation
        )
        self._planner, self._config, numbers = planner, mapper.config, mapper.config.exploration
        self.mission = Mission(exploration or NextBestView(robot.model, config=numbers), config=numbers)
        self._sinks: list[Sink] = []
        self.pilot = Pilot(robot, mapper, self._sinks, navigator)
        self.steps = 0
        self._failed_drives = 0

    def watch(self, *sinks: Sink) -> None:
        """Add sinks, which are notified of every event in the given order."""
        self._sinks += sinks
        self.mapper.observers += sinks

    @property
    def T_map_start(self) -> Pose | None:
        """Pose at which the robot started; None before the first step."""
        return self.mapper.T_map_start

    def step(self) -> Step:
        """Sense, localise, map, choose where to go next, and plan a path there."""
        mapper = self.mapper
        self.settle(waits=True)
        confirmed = self.pilot.look_around()
        keyframe = self.pilot.add(confirmed)
        self.reobservation.count(keyframe.frame)
        with mapper.stopwatch("exploration"):
            viewpoint, context = self.decide(keyframe)
            frontiers = find_frontiers(context)
            has_ended = viewpoint is None and self.mission.explores
            left = self.mission.left(context) if has_ended and not self.is_held else []
            ended = self._why_ended(context, left) if has_ended else None
        mapper.connect(keyframe, context.paths)
        with mapper.stopwatch("path_plan"):
            plan = self._plan(viewpoint, context) if viewpoint else None
        if plan is None:
            self.pilot.halt()
        can_drive = context.paths.start is not None and not self.is_held
        was_carried = bool(confirmed.was_carried) and self.steps > 0
        decided = viewpoint, plan, frontiers, left, self.mission.explores, ended, can_drive, was_carried
        step = Step(self.steps, keyframe, context, *decided)
        self.steps += 1
        for sink in self._sinks:
            sink.on_step(mapper, step)
        return step

    def _why_ended(self, context: Context, left: list[Viewpoint]) -> str:
        """Why exploration ends if no viewpoint was chosen."""
        if self.mission.is_out_of_time:
            return "time"
        if self.is_held:
            return "held"
        if context.paths.start is None:
            return "shut_in"
        return "not_worth_it" if left else "nothing_left"

    def settle(self, waits: bool = False) -> bool:
        """Correct the keyframe poses, the maps and everything anchored in them; True if the maps changed.

        ``waits``: whether to leave the maps alone until a correction is due.
        """
        moves = self.mapper.settle(waits)
        self.pilot.correct()
        return moves is not None

    def decide(self, keyframe: Keyframe) -> tuple[Viewpoint | None, Context]:
        """The viewpoint to drive to (None if there is none), and the context of the decision.

        If no path leads to a goal, not even over unseen ground, the search is repeated without the safety margin.
        """
        viewpoint, context = self._choose(keyframe)
        if viewpoint is None and not self.is_held and self.mission.tighten():
            return self._choose(keyframe)
        return viewpoint, context

    def _choose(self, keyframe: Keyframe) -> tuple[Viewpoint | None, Context]:
        # After failed drives clearance costs more, so that the same path is not tried again.
        caution, is_tight = 1.0 + self._failed_drives, self.mission.is_tight
        pose = self.pilot.next_pose(keyframe.T_map_base)
        context = context_of(self.mapper, keyframe, pose, caution, is_tight, self.reobservation)
        context = replace(context, driven=self.pilot.driven)
        self.mission.observe(context)
        return None if self.is_held else self.mission.choose(context), context

    def _plan(self, viewpoint: Viewpoint, context: Context) -> PathPlan | None:
        heading = viewpoint.heading if viewpoint.turn else None
        return self._planner.plan(self.mapper.topological_map, context.paths, viewpoint.position, heading)

    @property
    def is_held(self) -> bool:
        """Whether too many drives in a row have failed to get the robot away from its position."""
        return self._failed_drives >= self._config.explorer.patience

    def redirect(self, step: Step, viewpoint: Viewpoint) -> Step:
        """A copy of the step with a viewpoint chosen by the caller, and a plan that leads there if there is one."""
        self.mission.exploration.commit(viewpoint, step.context)
        return replace(step, viewpoint=viewpoint, plan=self._plan(viewpoint, step.context))

    def drive(self, step: Step) -> bool:
        """Follow the plan of a step and turn to the viewpoint's heading; True if the robot arrived.

        The robot stops in front of an obstacle that is not on the map; the next step then plans again.
        """
        if step.viewpoint is None or step.plan is None:
            return False
        pilot, config = self.pilot, self._config
        check = ObstacleCheck(step.traversability, step.keyframe.frame.sensor, config.navigation.obstacle_check)
        with self.mapper.stopwatch("navigation"):
            outcome = self._follow(step, step.viewpoint, step.plan, check)
        if outcome is Outcome.TILTED:
            halt = pilot.halts[-1].T_map_base[:2, 3]
            if not step.traversability.has_ramp(halt):
                pilot.pose_check.doubt()
        here, there = step.keyframe.T_map_base[:2, 3], pilot.T_map_base[:2, 3]
        got_away, reached = np.linalg.norm(there - here) > config.explorer.got_away, outcome is Outcome.REACHED
        self._failed_drives = 0 if got_away else self._failed_drives + (not reached)
        self._learn_from_drive(check.obstacles)
        return reached

    def _follow(self, step: Step, viewpoint: Viewpoint, plan: PathPlan, check: ObstacleCheck) -> Outcome:
        """Follow the plan of a step, slowly on ramps and near people."""
        ramps = [ramp.tree.data for ramp in self.mapper.segments.of(Label.INCLINED_RAMP)]
        people = [victim.points for victim in self.mapper.victims.confirmed]
        speed_limit = SpeedLimit(step.traversability, ramps, people, self._config.navigation)
        heading, start = viewpoint.heading if viewpoint.turn else None, step.keyframe.T_map_base[:2, 3]
        way = self._way(step, plan, heading)

        def is_done() -> bool:
            return self.mission.is_shown(self.mapper.elevation_map)

        planned = viewpoint.seconds - self._config.exploration.keyframe_time if viewpoint.seconds else None
        # If the robot is already rolling towards this viewpoint, it must arrive, or the next step chooses it again.
        rolls = viewpoint.turn and len(way) > 0 and not viewpoint.stands
        return self.pilot.follow(check, Course(way, heading, start, speed_limit, rolls, planned), is_done)

    def _way(self, step: Step, plan: PathPlan, heading: float | None) -> list[Stretch]:
        """The stretches of a plan, with arcs where level ground leaves room for them."""
        ground = step.traversability

        def fits(poses: Places) -> bool:
            return bool((ground.rooms(poses) >= 0).all() and not ground.grid.at(ground.ramp, poses).any())

        start, arcs = self.pilot.next_pose(step.keyframe.T_map_base), self._config.navigation.arcs
        return stretches_of(plan.way_points[:, :2], plan.backwards, start, heading, fits, arcs)

    def _learn_from_drive(self, obstacles: Points) -> None:
        """Report obstacles, the driven track and what the robot touched to the mapper."""
        elevation_map = self.mapper.elevation_map
        robot, cell = elevation_map.robot, elevation_map.grid.cell
        # If the robot did not get free, mapping an obstacle next to it would only trap it.
        touched = [halt.touched(robot, cell) for halt in self.pilot.halts if halt.touches]
        self.mapper.add_drive(self.pilot.track, obstacles, touched)


def context_of(
    mapper: Mapper, keyframe: Keyframe, pose: Place, caution: float, is_tight: bool, rewards: ViewpointRewards
) -> Context:
    """What the robot knows at a keyframe when it decides where to go; see :class:`PosePaths` for ``caution``.

    ``pose``: (3,) x, y and heading from which paths start. ``is_tight``: whether paths may do without the safety
    margin. ``rewards``: rewards of viewpoints that confirm finds.
    """
    ground = mapper.traversability.without_margin if is_tight else mapper.traversability
    paths = PosePaths(ground, pose[:2], float(pose[2]), caution)
    measured = mapper.elevation_map.measured
    return Context(keyframe.frame, keyframe.T_map_base, measured, paths, mapper.keyframes.poses, rewards)
