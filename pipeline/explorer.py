"""The whole pipeline (thesis, chapter 3): sense, localise, map, decide where to go, plan, drive."""

from dataclasses import replace

import numpy as np

from pipeline.arrays import Place, Places, Pose, Poses
from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration.frontiers import find_frontiers
from pipeline.exploration.mission import Mission
from pipeline.exploration.next_best_view import NextBestView
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint, ViewpointRewards
from pipeline.labels import Label
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.commands import Outcome
from pipeline.navigation.course import Course
from pipeline.navigation.navigator import Halt, Navigator
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.navigation.speed_limit import SpeedLimit
from pipeline.pilot import Pilot
from pipeline.planning.path_plan import TOPOLOGICAL, PathPlan, Planner
from pipeline.planning.pose_paths import PosePaths
from pipeline.planning.stretches import stretches_of
from pipeline.planning.way_back import is_cut_off, way_back
from pipeline.robot import Robot
from pipeline.sink import Sink, Step
from pipeline.tracks.reobservation import Reobservation

MAX_TOUCH_ERROR = 0.15
"""Maximum distance between a mapped hazard and the point at which the robot touched it, m, because poses are no more
accurate."""


class Explorer:
    """Explores with a robot: :meth:`step` updates the maps and the plan, and :meth:`drive` follows the plan.

    Attributes:
        mapper: holds all maps.
        reobservation: rewards other looks at unconfirmed or unread objects.
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

        ``navigator``: follows paths; by default, a navigator that commands velocities.
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
        self._failed_drives = self._ways_back = 0
        self._had_room = True  # Whether the last plan left room downhill on slopes

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
        # Correct: localisation moves keyframes after a loop closure, and the maps follow.
        self.apply_corrections(only_if_due=True)
        # Sense, localise and map (thesis 3.1 and 3.2).
        keyframe = self.pilot.take_keyframe()
        self.reobservation.count_try(keyframe.frame)
        # Choose a viewpoint, or drive back if no path leads to where the robot came from, or end the exploration.
        with mapper.stopwatch("exploration"):
            viewpoint, context, back = self.decide(keyframe)
            self._ways_back = self._ways_back + 1 if back else 0
            if back is not None:
                self.mission.set_out_without_strategy()
                viewpoint = Viewpoint(back.waypoints[-1, :2], 0.0, turn=False, gain=0.0, stands=True)
            frontiers = find_frontiers(context)
            has_ended = viewpoint is None and self.mission.explores
            left = self.mission.leftovers(context) if has_ended and not self.is_held else []
            end_reason = self._end_reason(context, left) if has_ended else None
        # Connect the ground that can be reached to the topological map (3.3).
        mapper.update_topological_map(keyframe, context.paths)
        # Plan a path to the viewpoint (3.4).
        with mapper.stopwatch("path_plan"):
            plan = back or (self._plan(viewpoint, context) if viewpoint else None)
        if plan is None:
            self.pilot.halt()
            if viewpoint is not None and self.mission.explores:
                end_reason = "unreachable"
        step = Step(
            number=self.steps,
            keyframe=keyframe,
            context=context,
            viewpoint=viewpoint,
            plan=plan,
            frontiers=frontiers,
            viewpoints_left=left,
            explores=self.mission.explores,
            end_reason=end_reason,
            can_drive=back is not None or (context.paths.start is not None and not self.is_held),
            was_carried=self.pilot.was_carried and self.steps > 0,
        )
        self.steps += 1
        for sink in self._sinks:
            sink.on_step(mapper, step)
        return step

    def _end_reason(self, context: Context, left: list[Viewpoint]) -> str:
        """Why exploration ends if no viewpoint was chosen."""
        if self.mission.is_out_of_time:
            return "time"
        if self.is_held:
            return "held"
        if context.paths.start is None or is_cut_off(self._own_poses(context), context.paths):
            return "shut_in"
        return "not_worth_it" if any(view.is_reachable for view in left) else "nothing_left"

    def apply_corrections(self, only_if_due: bool = False) -> bool:
        """Correct the keyframe poses, the maps and everything anchored in them; True if the maps changed.

        ``only_if_due``: whether to leave the maps unchanged until a correction is due.
        """
        moves = self.mapper.apply_corrections(only_if_due)
        self.pilot.correct()
        return moves is not None

    def decide(self, keyframe: Keyframe) -> tuple[Viewpoint | None, Context, PathPlan | None]:
        """The viewpoint to drive to, the context of the decision, and a plan back along the robot's own track.

        If the search yields no viewpoint, the following steps are tried in turn until one of them yields a viewpoint
        or a plan back:

        - If there are ramps, and the last plan left room downhill on slopes: a plan back, because the robot may have
          slid to where it has no room downhill.
        - If there are ramps: a search without room downhill, at the risk that the robot leans or slides into an
          obstacle.
        - If the task is to drive to goals: a search without the safety margin.
        - A plan back.
        """
        viewpoint, context = self._choose(keyframe)
        had_room, self._had_room = self._had_room, True
        if viewpoint is None and not self.is_held and context.traversability.ramp.any():
            if had_room and (back := self._way_back(context)):
                return None, context, back
            fallback = self._choose(keyframe, ignores_downhill_room=True)
            if fallback[0] is not None:
                viewpoint, context = fallback
                self._had_room = False
        if viewpoint is None and not self.is_held and self.mission.tighten():
            viewpoint, context = self._choose(keyframe)
        return viewpoint, context, self._way_back(context) if viewpoint is None else None

    def _choose(self, keyframe: Keyframe, ignores_downhill_room: bool = False) -> tuple[Viewpoint | None, Context]:
        # After failed drives, too little clearance costs more, so that the same path is not tried again.
        caution, ignores_margin = 1.0 + self._failed_drives, self.mission.ignores_margin
        pose = self.pilot.navigator.stopping_pose(keyframe.T_map_base)
        context = context_of(
            self.mapper, keyframe, pose, caution, ignores_margin, self.reobservation, ignores_downhill_room
        )
        context = replace(context, driven=self.pilot.driven)
        self.mission.observe(context)
        return None if self.is_held else self.mission.choose(context), context

    def _way_back(self, context: Context) -> PathPlan | None:
        """A plan back along the robot's own track, if no path leads to the ground from which the robot came."""
        if self.is_held or self.mission.is_out_of_time or self._ways_back >= self._config.explorer.max_failed_drives:
            return None
        return way_back(self._own_poses(context), context.paths)

    def _own_poses(self, context: Context) -> Poses:
        """(K, 4, 4) poses of the keyframes of this episode."""
        return context.poses[self.mapper.keyframes.loaded_count :]

    def _plan(self, viewpoint: Viewpoint, context: Context) -> PathPlan | None:
        heading = viewpoint.heading if viewpoint.turn else None
        return self._planner.plan(self.mapper.topological_map, context.paths, viewpoint.position, heading)

    @property
    def is_held(self) -> bool:
        """Whether too many drives in a row have failed to get the robot away from its position."""
        return self._failed_drives >= self._config.explorer.max_failed_drives

    def redirect(self, step: Step, viewpoint: Viewpoint) -> Step:
        """A copy of the step with a viewpoint chosen by the caller, and a plan that leads there if there is one.

        The step's own viewpoint has been committed to and planned for, so the step is returned as it is.
        """
        if viewpoint is step.viewpoint:
            return step
        self.mission.exploration.commit(viewpoint, step.context)
        return replace(step, viewpoint=viewpoint, plan=self._plan(viewpoint, step.context))

    def drive(self, step: Step) -> bool:
        """Follow the plan of a step and turn to the viewpoint's heading; True if the robot arrived.

        The result is also True if the drive ended early because the map already shows what the robot set out to see.
        The robot stops in front of an obstacle that is not on the map, beside a person of whom the plan did not know,
        or if it slides off its path; the next step then plans again.
        """
        viewpoint, plan = step.viewpoint, step.plan
        if viewpoint is None or plan is None:
            return False
        mapper, pilot, navigator = self.mapper, self.pilot, self.pilot.navigator
        config = self._config
        ground = step.traversability
        here = step.keyframe.T_map_base[:2, 3]

        # Turn the plan into stretches, joined by arcs where level ground leaves room for them.
        def fits(poses: Places) -> bool:
            return bool((ground.pose_clearances(poses) >= 0).all() and not ground.grid.at(ground.ramp, poses).any())

        start = navigator.stopping_pose(step.keyframe.T_map_base)
        heading = viewpoint.heading if viewpoint.turn else None
        way = stretches_of(plan.waypoints[:, :2], plan.backwards, start, heading, fits, config.navigation.arcs)

        # Follow them, slowly on ramps and near people, until the map shows the ground that the robot set out to
        # see.
        ramps = [ramp.tree.data for ramp in mapper.segments.of(Label.INCLINED_RAMP)]
        people = mapper.people
        speed_limit = SpeedLimit(ground, ramps, people, config.navigation)
        planned = viewpoint.seconds - config.exploration.keyframe_time if viewpoint.seconds else None
        # A robot that is already rolling towards this viewpoint must stop there, or the next step would choose it
        # again.
        rolls = viewpoint.turn and len(way) > 0 and not viewpoint.stands
        check = ObstacleCheck(
            ground,
            step.keyframe.frame.sensor,
            config.navigation.obstacle_check,
            people,
            config.navigation.speed_limit.beside_people,
        )
        course = Course(way, heading, here, speed_limit, rolls, planned)
        with mapper.stopwatch("navigation"):
            outcome = pilot.follow(check, course, lambda: self.mission.is_shown(mapper.elevation_map))

        # Judge the drive: a tilt where the map shows no ramp casts doubt on the pose.
        reached = outcome is Outcome.REACHED
        if outcome is Outcome.TILTED and not ground.has_ramp(navigator.halts[-1].T_map_base[:2, 3]):
            pilot.pose_check.doubt()
        if np.linalg.norm(navigator.T_map_base[:2, 3] - here) > config.explorer.min_drive_distance:
            self._failed_drives = 0
        elif not reached:
            self._failed_drives += 1

        # Learn where the robot drove, which obstacles blocked it and which it touched. If the robot did not get free
        # from an obstacle, mapping this obstacle would only trap the robot.
        touched = [probable_contact_points(halt, ground) for halt in navigator.halts if halt.is_contact]
        mapper.add_drive(np.array(navigator.track).reshape(-1, 3), check.obstacles, touched)
        return reached


def probable_contact_points(halt: Halt, ground: Traversability) -> Places:
    """(N, 3) points, m, that a robot probably touched with its leading end, according to the map of its drive.

    Perhaps only one corner of the robot touched something, so the points next to mapped hazards are chosen, or the
    whole end if there are none. If the whole end were always chosen, a corner that touches a wall would block the
    passage.
    """
    points = halt.contact_points(ground.robot, ground.grid.cell)
    may_be = ground.grid.at(ground.to_hazard, points[:, :2], outside=np.inf) <= MAX_TOUCH_ERROR
    return points[may_be] if may_be.any() else points


def context_of(
    mapper: Mapper,
    keyframe: Keyframe,
    pose: Place,
    caution: float,
    ignores_margin: bool,
    rewards: ViewpointRewards,
    ignores_downhill_room: bool = False,
) -> Context:
    """The context in which the robot decides where to go at a keyframe.

    Args:
        mapper: holds all maps.
        keyframe: the newest keyframe.
        pose: (3,) x and y, m, and heading, rad, at which paths start.
        caution: see :class:`PosePaths`.
        ignores_margin: whether paths may do without the safety margin.
        rewards: rewards for viewpoints that confirm finds.
        ignores_downhill_room: whether paths may do without room downhill.
    """
    ground = mapper.drivable.without_downhill_room if ignores_downhill_room else mapper.drivable
    ground = ground.without_margin if ignores_margin else ground
    paths = PosePaths(ground, pose[:2], float(pose[2]), caution)
    measured = mapper.elevation_map.measured
    return Context(keyframe.frame, keyframe.T_map_base, measured, paths, mapper.keyframes.poses, rewards)
