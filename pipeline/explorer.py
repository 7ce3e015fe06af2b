"""The whole pipeline (thesis, chapter 3): sense, map, decide where to go, plan, drive."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.exploration.next_best_view import Exploration
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.frame import Frame
from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.odometry import Localisation, LostError
from pipeline.localisation.relocalisation import Relocalisation
from pipeline.mapper import Keyframe, Mapper
from pipeline.mission import Mission
from pipeline.navigation.navigator import Navigator, Outcome
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.navigation.recovery import backtrack, escape, touched
from pipeline.planning.path_plan import PathPlan, plan_path
from pipeline.robot import Robot
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.transforms import inverse
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability
from pipeline.victims.detection.detection import Detector
from pipeline.victims.reobservation import Reobservation

KEYFRAME_WAY, KEYFRAME_TURN = 0.3, np.deg2rad(15)
"""m and rad that the robot drives or turns from one keyframe to the next."""
LABELLED = 2
"""Of so many keyframes that are taken while the robot drives one is labelled: the network takes longest of all."""
LOOKS = 8
"""Frames that a robot takes around itself when it does not know where it is."""
UNSURE = 0.98, 0.7
"""Agreement and overlap of a frame, of which one at least is better where the robot is where it believes to be: so
were those of all 56 steps of two episodes."""
KIDNAPPED = 0.3
"""m; a robot that is elsewhere by this without having driven was carried there."""
PATIENCE = 6
"""Failed drives since one last brought the robot further than ``KIDNAPPED``, after which it stays."""


@dataclass(frozen=True, eq=False)
class Step:
    """What a step has found out and decided.

    Attributes:
        keyframe: what was sensed, and what came of it.
        context: on which the decision was made.
        viewpoint: where to go next; None if nothing is left to go for.
        plan: the way there.
        frontiers: (N, 3) centres of the frontiers left, m in ``map``.
        can_drive: whether the robot stands where it can drive, and was not held again and again.
        was_kidnapped: whether the robot is elsewhere than it drove since the last step.
    """

    keyframe: Keyframe
    context: Context
    viewpoint: Viewpoint | None
    plan: PathPlan | None
    frontiers: NDArray[np.float64]
    can_drive: bool
    was_kidnapped: bool

    @property
    def traversability(self) -> Traversability:
        """Where the robot may drive."""
        return self.keyframe.traversability


class Explorer:
    """Explores with a robot: each :meth:`step` renews the maps and the plan, each :meth:`drive` follows the plan.

    Attributes:
        robot: the body.
        mapper: all maps.
        mission: what to do next.
        navigator: drives.
        relocalised: how often the robot found its place again after it was carried.
        track: (N, 2) m in ``map``, where the robot has been since it was set down.
        steps: how many were made.
        on_keyframe: called with every keyframe, also those taken while the robot drives.
        T_odom_expected: 4×4 pose where the last step or drive left the robot; None if it was kidnapped.
    """

    def __init__(
        self,
        robot: Robot,
        classifier: PointClassifier,
        detector: Detector | None = None,
        *,
        voxel_size: float = 0.1,
        graph: Literal["mst", "roadmap"] = "roadmap",
        seed: int = 0,
        localisation: Localisation | None = None,
    ):
        """Begin where the robot stands; the parameters are those of :class:`pipeline.mapper.Mapper`."""
        self.robot = robot
        self.mapper = Mapper(robot.model, classifier, detector, voxel_size, graph, seed, localisation)
        self.reobservation = Reobservation(self.mapper.victims, self.mapper.metric_map)
        exploration = Exploration(robot.model)
        exploration.rewards = self.reobservation
        self.mission = Mission(exploration, self.mapper.topological_map)
        self.navigator = Navigator(robot, look=self._look)
        self.steps = 0
        self.on_keyframe: Callable[[Keyframe], object] = lambda keyframe: None
        self.T_odom_expected: NDArray[np.float64] | None = None
        self.track = np.zeros((0, 2))
        self.relocalised = 0
        self._failed_drives = 0
        self._T_odom_keyframe = np.eye(4)

    def step(self) -> Step:
        """Sense, localise, map, decide where to go next and plan the way there."""
        self.settle()
        with self.mapper.stopwatch("sense"):
            frame = self.robot.sense()
        self.navigator.look = lambda: True
        frame, is_there = self._confirm(frame)
        frame = frame if is_there else self._find_place(frame)
        self.navigator.look = self._look
        was_kidnapped = self._notice_kidnapping(frame)
        keyframe = self._add(frame, labelled=True)
        self.steps += 1
        self.reobservation.count(frame)
        with self.mapper.stopwatch("exploration"):
            viewpoint, context, approach = self.decide(keyframe)
            frontiers = self.mission.exploration.find_frontiers(context)
        self.mapper.connect(keyframe, context.paths)
        with self.mapper.stopwatch("path_plan"):
            plan = self._plan(viewpoint, context, approach) if viewpoint else None
        can_drive = context.paths.start is not None and not self.is_held
        return Step(keyframe, context, viewpoint, plan, frontiers, can_drive, was_kidnapped)

    def drive(self, step: Step) -> bool:
        """Follow the plan of a step and turn to its viewpoint; True if all of it was reached.

        The robot stops where something stands in its way that the map does not show: the next step plans anew.
        """
        if step.viewpoint is None or step.plan is None:
            return False
        T_map_start, viewpoint = step.keyframe.T_map_base, step.viewpoint
        check = ObstacleCheck(self._returns, step.traversability)
        with self.mapper.stopwatch("navigation"):
            reached = self.navigator.follow(
                step.plan.way_points,
                viewpoint.heading if viewpoint.turn else None,
                self._backs_up(step, step.plan),
                T_map_start[:2, 3],
                check.is_clear,
            )
        T_map_base = self.navigator.T_map_base
        was_kidnapped = self.navigator.legs[-1].outcome is Outcome.MOVED
        assert self.navigator.motion is not None
        self.T_odom_expected = None if was_kidnapped else self.navigator.motion.T_odom_base
        came_away = np.linalg.norm(T_map_base[:2, 3] - T_map_start[:2, 3]) > KIDNAPPED
        self._failed_drives = 0 if came_away else self._failed_drives + (not reached)
        self._learn_from_drive(check.obstacles)
        return reached

    @property
    def _is_lost(self) -> bool:
        """Whether it has yet to find its place in the map of an earlier episode."""
        return self.mapper.localisation.may_err and 0 < self.mapper.keyframes == self.mapper.loaded

    @property
    def T_map_start(self) -> NDArray[np.float64] | None:
        """4×4 pose at which the robot began; None before the first step."""
        return self.mapper.T_map_start

    @property
    def is_held(self) -> bool:
        """Whether drive after drive failed since the robot last got anywhere."""
        return self._failed_drives >= PATIENCE

    def decide(self, keyframe: Keyframe) -> tuple[Viewpoint | None, Context, NDArray[np.float64]]:
        """Where to go, the context in which that was decided, and (N, 2) m over which the robot first gets there.

        If nothing is left to go for from where the robot can get to, it decides from where it came. Where nothing is
        left there either, the paths are those that lead further, for the topological map is made of them.
        """
        traversability, T_map_base = keyframe.traversability, keyframe.T_map_base
        start = escape(traversability, T_map_base, self._failed_drives > 0)
        paths = ShortestPaths(traversability, start)
        measured = self.mapper.elevation_map.measured
        context = Context(keyframe.frame, T_map_base, measured, paths)
        self.mission.observe(context)
        if (viewpoint := self._choose(context)) is not None:
            return viewpoint, context, start[None]
        back = backtrack(paths, self.track)
        if back is None:
            return None, context, start[None]
        beyond = replace(context, paths=ShortestPaths(traversability, back[-1]))
        viewpoint = self._choose(beyond)
        if viewpoint is not None or beyond.paths.reachable.sum() > paths.reachable.sum():
            return viewpoint, beyond, back
        return None, context, start[None]

    def _choose(self, context: Context) -> Viewpoint | None:
        """The mission's next viewpoint, to which the robot now sets out; None for a robot that is held."""
        choice = None if self.is_held else self.mission.next_viewpoint(context)
        if choice is None:
            return None
        strategy, viewpoint = choice
        strategy.commit(viewpoint, context)
        return viewpoint

    def _plan(self, viewpoint: Viewpoint, context: Context, approach: NDArray[np.float64]) -> PathPlan | None:
        """The way over the approach (N, 2) to a viewpoint, by the place where the robot has to turn for it."""
        traversability, here = context.traversability, context.T_map_base[:3, 3]
        goal = viewpoint.position if viewpoint.via is None else viewpoint.via
        plan = plan_path(self.mapper.topological_map, context.paths, goal)
        if plan is not None and viewpoint.via is not None:
            plan = plan.on_to(traversability.on_ground(viewpoint.position[None]))
        if plan is not None and (approach != here[:2]).any():
            plan = plan.after(traversability.on_ground(approach), here)
        return plan

    def _backs_up(self, step: Step, plan: PathPlan) -> bool | None:
        """Whether to drive the last leg backwards; None, either will do, where the robot could not turn before it."""
        traversability = step.traversability
        start = np.vstack([step.keyframe.T_map_base[:3, 3], plan.way_points])[-2]
        can_turn = traversability.grid.at(traversability.can_turn, start)
        return step.viewpoint.backwards if step.viewpoint is not None and can_turn else None

    def _learn_from_drive(self, obstacles: NDArray[np.float32]) -> None:
        """Tell the mapper what stood in the way (N, 3), where the robot was and what it touched."""
        track = np.array(self.navigator.track).reshape(-1, 2)
        # An obstacle beside a robot that cannot leave would only shut it in.
        halts = [halt for halt in self.navigator.halts if halt.touches]
        self.mapper.add_drive(track, obstacles, [touched(halt, self.robot.model) for halt in halts])
        self.track = np.vstack([self.track, track])

    def settle(self) -> None:
        """Correct the keyframes' poses; the maps, and what is known by its place in them, follow."""
        correction = self.mapper.settle()
        if correction is not None:
            self.mission.exploration.correct(correction)
            self.reobservation.correct(correction)
            self.track = correction.moved(self.track)
        self.navigator.T_map_odom = self.mapper.localisation.T_map_odom

    def _add(self, frame: Frame, labelled: bool) -> Keyframe:
        keyframe = self.mapper.add(frame, self.mapper.localise(frame), labelled)
        self._T_odom_keyframe = frame.T_odom_base
        self.navigator.T_map_odom = self.mapper.localisation.T_map_odom
        self.on_keyframe(keyframe)
        return keyframe

    def _confirm(self, frame: Frame) -> tuple[Frame, bool]:
        """Look around until the robot knows whether it is where it believes to be: the newest frame, and whether."""
        localisation = self.mapper.localisation
        if not localisation.may_err or self._is_lost:
            return frame, not self._is_lost
        found = self._agreement(frame)
        for _ in range(LOOKS):
            is_elsewhere = found.was_carried or localisation.is_contradicted
            is_doubtful = found.is_doubtful or (found.share < UNSURE[0] and localisation.overlap < UNSURE[1])
            if is_elsewhere or not is_doubtful or not self.navigator.turn(2 * np.pi / LOOKS):
                break
            frame = self.robot.sense()
            found = Agreement.of([found, self._agreement(frame)])
        return frame, not (found.was_carried or localisation.is_contradicted or found.is_doubtful)

    def _agreement(self, frame: Frame) -> Agreement:
        """How a frame agrees with the map where the robot believes to be."""
        return agreement(frame, self.mapper.localise(frame) @ frame.T_base_camera, self.mapper.metric_map)

    def _find_place(self, frame: Frame) -> Frame:
        """Look around until the robot knows where it is; the newest frame.

        Raises:
            LostError: it remains in doubt.
        """
        mapper, relocalisation = self.mapper, Relocalisation(self.robot.model)
        for _ in range(LOOKS):
            relocalisation.add(frame)
            T = relocalisation.find(mapper.metric_map, mapper.elevation_map, mapper.localisation.points())
            if T is not None:
                mapper.localisation.set_down(T)
                self.relocalised += 1
                self.T_odom_expected = None
                return frame
            if not self.navigator.turn(2 * np.pi / LOOKS):
                break
            frame = self.robot.sense()
        raise LostError("the camera shows what the map does not, and no place fits for sure")

    def _look(self) -> bool:
        """Take a keyframe if the robot has come far enough; False if it is not where it believes to be."""
        assert self.navigator.motion is not None
        motion = inverse(self._T_odom_keyframe) @ self.navigator.motion.T_odom_base
        turn = np.arccos(np.clip((np.trace(motion[:3, :3]) - 1) / 2, -1, 1))
        if np.linalg.norm(motion[:3, 3]) >= KEYFRAME_WAY or turn >= KEYFRAME_TURN:
            frame = self.robot.sense()
            if self.mapper.localisation.may_err and self._agreement(frame).was_carried:
                return False
            self._add(frame, labelled=self.mapper.keyframes % LABELLED == 0)
        return True

    def _returns(self) -> NDArray[np.float32]:
        """(N, 3) the returns that the camera has now, of a keyframe, m in ``map``."""
        frame: Frame = self.robot.sense()
        return frame.points(self._add(frame, labelled=False).T_map_base @ frame.T_base_camera)

    def _notice_kidnapping(self, frame: Frame) -> bool:
        """Whether the robot is elsewhere than it drove; the ground is assumed flat wherever it is set down."""
        last, self.T_odom_expected = self.T_odom_expected, frame.T_odom_base
        set_down = last is None or bool(np.linalg.norm(frame.T_odom_base[:3, 3] - last[:3, 3]) > KIDNAPPED)
        if set_down:
            self.track = np.zeros((0, 2))
            self.mapper.assume_ground(self.mapper.localise(frame))
        return set_down and self.steps > 0
