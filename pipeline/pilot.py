"""The pilot: sends commands to the robot, senses, and takes keyframes while driving.

It makes no decisions: the navigator chooses the commands, the pose check the views that it needs, and the mapper
which frames are new.
"""

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.arrays import Place, Places, Points, Pose
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.localisation.belief import MotionState
from pipeline.localisation.localisation import Localised, LostError
from pipeline.localisation.pose_check import Confirmed, PoseCheck
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.commands import STOP, Approach, Commands, Outcome, Verdict
from pipeline.navigation.course import Course
from pipeline.navigation.faults import Faults
from pipeline.navigation.navigator import DrivenLeg, Halt, Navigator
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.robot import Robot, Velocity
from pipeline.sink import Sink


class Pilot:
    """Moves a robot as requested by a navigator and a pose check.

    Attributes:
        robot: the robot to move.
        navigator: computes the commands that follow a path.
        pose_check: checks whether the robot is where it believes to be.
        faults: faults of the robot's sensors and wheels.
        driven: distance driven so far by odometry, m.
    """

    def __init__(self, robot: Robot, mapper: Mapper, sinks: Sequence[Sink], navigator: Navigator | None = None):
        """``sinks``: notified of each motion; may grow. ``navigator``: by default one that commands velocities."""
        localisation, navigation = mapper.config.localisation, mapper.config.navigation
        self.robot, self.faults = robot, Faults(navigation.faults, localisation.vertical)
        self.navigator = navigator or Navigator(robot.model, robot.control_period, navigation)
        maps = mapper.localisation, mapper.metric_map, mapper.elevation_map, mapper.keyframes
        self.pose_check = PoseCheck(*maps, robot.model, localisation)
        self._mapper, self._sinks, self._carried_way = mapper, sinks, localisation.pose_check.carried_way
        self.driven = 0.0
        self._is_done: Callable[[], bool] = lambda: False
        self._last: Frame | None = None
        self._T_odom_left: Pose | None = None  # Where the last drive ended; None if the robot was carried

    @property
    def T_map_base(self) -> Pose:
        """The robot's pose after its newest motion."""
        return self.navigator.T_map_base

    def next_pose(self, T_map_base: Pose) -> Place:
        """(3,) x, y and heading in ``map`` from which the next path of a robot at a pose starts.

        The robot may still roll to the end of its current path.
        """
        return self.navigator.next_pose(T_map_base)

    @property
    def track(self) -> Places:
        """(N, 3) x, y, m, and headings, rad, of the robot on its newest path."""
        return np.array(self.navigator.track).reshape(-1, 3)

    @property
    def halts(self) -> list[Halt]:
        """The robot's halts on its newest path."""
        return self.navigator.halts

    @property
    def relocalised(self) -> int:
        """Number of times that the robot was relocalised after being carried."""
        return self.pose_check.relocalised

    @property
    def newest_leg(self) -> DrivenLeg:
        """The most recent leg."""
        return self.navigator.legs[-1]

    def look_around(self) -> Confirmed:
        """Look around until the pose is confirmed; return the newest frame, and whether the robot was carried.

        Raises:
            LostError: the pose remains in doubt, or the camera no longer measures anything.
        """
        last = self._last
        with self._mapper.stopwatch("sense"):
            localised = self._sense()
        if last is None:
            self.faults.check_depth_scale(localised.frame)
        views = self.pose_check.confirm(localised, last)
        try:
            angle = next(views)
            while True:
                can_turn = self._run(self.navigator.turn(angle)) is Outcome.REACHED
                angle = views.send(self._sense() if can_turn else None)
        except StopIteration as end:
            localised, was_carried = end.value
        left, self._T_odom_left = self._T_odom_left, localised.frame.T_odom_base
        if was_carried is None:
            moved = np.inf if left is None else np.linalg.norm((self._T_odom_left - left)[:3, 3])
            was_carried = bool(moved > self._carried_way)
        return Confirmed(localised, was_carried)

    def add(self, confirmed: Confirmed) -> Keyframe:
        """Make a confirmed frame a labelled keyframe, and continue with its pose."""
        keyframe = self._mapper.add(confirmed.localised, labelled=True, set_down=bool(confirmed.was_carried))
        self.correct()
        return keyframe

    def correct(self) -> None:
        """Pass the newest estimate of the robot's pose to the navigator."""
        self.navigator.correct(self._mapper.T_map_odom)

    def follow(self, check: ObstacleCheck, course: Course, is_done: Callable[[], bool] = lambda: False) -> Outcome:
        """Follow a course as :meth:`Navigator.follow` does, taking keyframes and watching for obstacles.

        ``is_done``: called after each keyframe; the drive ends early if it returns True.
        """
        self._is_done = is_done
        outcome = self._run(self.navigator.follow(course), check)
        motion = self.navigator.motion
        self._T_odom_left = None if outcome is Outcome.MOVED or motion is None else motion.T_odom_base
        return outcome

    def halt(self) -> None:
        """Stop the robot if it is still rolling."""
        if self.navigator.motion is not None:
            self._run(self.navigator.halt())

    def _run(self, commands: Commands, check: ObstacleCheck | None = None) -> Outcome:
        """Send commands to the robot one by one while it may follow them; without a check, nothing is checked."""
        try:
            command = next(commands)
            while True:
                verdict = Verdict.FINE if check is None else self._watch(command, check)
                if verdict is Verdict.FINE:
                    self._move(command)
                command = commands.send(verdict)
        except StopIteration as end:
            return end.value

    def _move(self, command: Velocity) -> None:
        """Let the robot follow a command for a control period; without odometry, stop it and raise LostError."""
        before, motion = self.navigator.motion, self.robot.drive(command)
        try:
            self.navigator.moved(motion)
        except LostError:
            self.robot.drive(STOP)  # Stop before anything else
            raise
        if before is not None:
            self.driven += float(np.linalg.norm((motion.T_odom_base - before.T_odom_base)[:3, 3]))
        for sink in self._sinks:
            sink.on_motion(motion)

    def _watch(self, command: Velocity, check: ObstacleCheck) -> Verdict:
        """Whether the robot may follow a command."""
        if command == STOP:
            return Verdict.FINE
        verdict = self._look()
        if verdict is Verdict.FINE and isinstance(command, Approach) and command.v > 0:
            if check.is_due(command):
                check.look(command, self._returns())
            return Verdict.FINE if check.is_clear(command) else Verdict.BLOCKED
        return verdict

    def _look(self) -> Verdict:
        """If a keyframe is due, localise a new frame and make it a keyframe unless it repeats one."""
        assert self.navigator.motion is not None
        if not self._mapper.is_due(self.navigator.motion.T_odom_base):
            return Verdict.FINE
        localised, belief = self._sense(), self._mapper.belief
        self.pose_check.compare(localised, is_driving=True)
        self.faults.check_motion(belief, localised.frame.time)
        if not belief.knows_place:
            return Verdict.UNSURE
        self._mapper.offer(localised)
        self.correct()
        if belief.is_sure_of(MotionState.HELD):
            return Verdict.SPINNING
        return Verdict.DONE if self._is_done() else Verdict.FINE

    def _returns(self) -> Points:
        """The camera's current returns in ``map``; their frame becomes a keyframe."""
        keyframe = self._mapper.add(self._sense(), labelled=False)
        self.correct()
        return keyframe.frame.points(keyframe.T_map_base @ keyframe.frame.T_base_camera)

    def _sense(self) -> Localised:
        localised = self._mapper.localise(self._frame())
        self._last = localised.frame
        self.pose_check.check_depth(localised)
        return localised

    def _frame(self) -> Frame:
        """The camera's newest frame; LostError if it fails twice in a row."""
        try:
            return self.robot.sense()
        except InputError:
            raise
        except Exception as error:  # Drivers raise exceptions of all kinds
            time = self.navigator.motion.time if self.navigator.motion else 0.0
            self.faults.note("camera", time, f"the camera delivered no frame: {error or type(error).__name__}")
        try:
            return self.robot.sense()
        except Exception as error:
            raise LostError(f"the camera twice delivered no frame: {error or type(error).__name__}") from error
