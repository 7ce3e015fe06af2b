"""The pilot: sends commands to the robot, senses, and takes keyframes while driving.

It makes no decisions: the navigator chooses the commands, the pose check chooses the views that it needs, and the
mapper decides which frames are new.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from pipeline.arrays import Pose
from pipeline.errors import InputError, required
from pipeline.frame import Frame
from pipeline.localisation.belief import MotionState
from pipeline.localisation.localisation import LocalisedFrame, LostError
from pipeline.localisation.pose_check import ConfirmedPose, PoseCheck
from pipeline.mapper import Keyframe, Mapper, sense_and_map
from pipeline.navigation.commands import STOP, Approach, Outcome, Verdict
from pipeline.navigation.course import Course
from pipeline.navigation.faults import Faults
from pipeline.navigation.navigator import Navigator
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.robot import Robot, Velocity
from pipeline.sink import Sink


class Pilot:
    """Moves a robot as requested by a navigator and a pose check.

    Attributes:
        robot: the robot to move.
        navigator: computes the commands that follow a path.
        pose_check: checks whether the robot is where it believes itself to be.
        faults: faults of the robot's sensors and wheels.
        driven: distance driven so far by odometry, m.
        was_carried: whether the robot was carried between its last two stops, or set down at the start.
    """

    def __init__(self, robot: Robot, mapper: Mapper, sinks: Sequence[Sink], navigator: Navigator | None = None):
        """Control a robot, and add its keyframes to a mapper's maps.

        ``sinks``: notified of each motion; sinks may be added later. ``navigator``: by default, a navigator that
        commands velocities.
        """
        localisation, navigation = mapper.config.localisation, mapper.config.navigation
        self.robot = robot
        self.faults = Faults(navigation.faults)
        self.navigator = navigator or Navigator(robot.model, robot.control_period, navigation)
        maps = mapper.localisation, mapper.metric_map, mapper.elevation_map, mapper.keyframes
        self.pose_check = PoseCheck(*maps, robot.model, localisation)
        self.driven = 0.0
        self.was_carried = False
        self._mapper = mapper
        self._sinks = sinks
        self._min_carried_distance = localisation.pose_check.min_carried_distance
        self._last: Frame | None = None
        self._T_odom_left: Pose | None = None  # Where the last drive ended; None if the robot was carried

    def take_keyframe(self) -> Keyframe:
        """Make a labelled keyframe where the robot stands, turning for other views until its pose is confirmed.

        Raises:
            LostError: the pose remains in doubt, or the camera no longer measures anything.
        """
        keyframe = required(sense_and_map(self._mapper, self.sense, self.confirm, labelled=True, may_repeat=True))
        self.correct()
        return keyframe

    def confirm(self, localised: LocalisedFrame) -> ConfirmedPose:
        """The newest frame, whose pose is certain, and whether the robot was carried or set down there.

        Raises:
            LostError: the pose remains in doubt, or the camera no longer measures anything.
        """
        last = self._last
        self._remember(localised)
        if last is None:
            self.faults.check_depth_scale(localised.frame)

        # The distance is computed first, because the robot may roll to a stop, turn, and drive back to confirm its
        # pose.
        here, left = localised.frame.T_odom_base, self._T_odom_left
        moved = np.inf if left is None else np.linalg.norm((here - left)[:3, 3])
        localised, was_carried = self._confirmed(localised, last)
        self._T_odom_left = localised.frame.T_odom_base
        if was_carried is None:
            was_carried = bool(moved > self._min_carried_distance)
        self.was_carried = was_carried
        return ConfirmedPose(localised, was_carried)

    def _confirmed(self, localised: LocalisedFrame, last: Frame | None) -> ConfirmedPose:
        """Turn for other views until the pose is confirmed.

        If this fails after a halt, or shows that the robot is still held, the robot drives back and looks again.
        """
        for _ in range(self._mapper.config.navigation.recovery.drives_back):
            try:
                confirmed = self.pose_check.confirm(localised, last, self._turn)
            except LostError:
                if not self.navigator.drive_back(self._move):
                    raise
            else:
                if confirmed.was_carried or not self.navigator.is_still_held(self._mapper.T_map_odom):
                    return confirmed
                self.correct()
                self.navigator.drive_back(self._move)
            last, localised = None, self._remember(self._mapper.localise(self.sense()))
        return self.pose_check.confirm(localised, last, self._turn)

    def _turn(self, angle: float) -> LocalisedFrame | None:
        """Turn by an angle, rad, and localise a frame taken after the turn; None if the robot cannot turn."""
        can_turn = self.navigator.turn(angle, self._move) is Outcome.REACHED
        return self._remember(self._mapper.localise(self.sense())) if can_turn else None

    def correct(self) -> None:
        """Pass the newest estimate of the robot's pose to the navigator."""
        self.navigator.correct(self._mapper.T_map_odom)
        dropped = getattr(self._mapper.localisation, "dropped", 0)  # A user's own localisation may lack this count
        if dropped and self._last is not None:
            self.faults.note("registration", self._last.time, f"{dropped} registrations were invalid and left out")

    def follow(self, check: ObstacleCheck, course: Course, is_done: Callable[[], bool] = lambda: False) -> Outcome:
        """Follow a course as :meth:`Navigator.follow` does, while taking keyframes and watching for obstacles.

        ``is_done``: called after each frame taken on the drive; the drive ends early if it returns True.
        """
        outcome = self.navigator.follow(course, partial(self._follow_if_clear, check, is_done))
        self._remember_end(outcome)
        return outcome

    def halt(self) -> None:
        """Stop the robot if it is still rolling."""
        if self.navigator.motion is not None:
            self._remember_end(self.navigator.halt(self._move))

    def _remember_end(self, outcome: Outcome) -> None:
        """Remember where a drive ended, unless the robot was carried after its pose was confirmed."""
        was_carried = outcome is Outcome.CARRIED or self._T_odom_left is None
        self._T_odom_left = None if was_carried else required(self.navigator.motion).T_odom_base

    def _follow_if_clear(self, check: ObstacleCheck, is_done: Callable[[], bool], command: Velocity) -> Verdict:
        """Let the robot follow a command if its pose is certain and its path is clear."""
        verdict = Verdict.FINE if command == STOP else self._map_and_check(check, is_done, command)
        return self._move(command) if verdict is Verdict.FINE else verdict

    def _map_and_check(self, check: ObstacleCheck, is_done: Callable[[], bool], command: Velocity) -> Verdict:
        """If a keyframe or an obstacle check is due, map a frame, and judge whether the robot may drive on.

        A frame that repeats another is mapped only for an obstacle check.
        """
        mapper, belief = self._mapper, self._mapper.belief
        path = command if isinstance(command, Approach) else None
        checked = path if path is not None and path.v > 0 and check.is_due(path) else None
        if checked is None and not mapper.is_due(required(self.navigator.motion).T_odom_base):
            return Verdict.FINE

        def compare(localised: LocalisedFrame) -> ConfirmedPose | None:
            self.pose_check.compare(self._remember(localised), is_driving=True)
            self.faults.check_motion(belief, localised.frame.time)
            if checked is not None:
                check.look(checked, localised.frame.points(localised.T_map_camera))
            return ConfirmedPose(localised, None) if belief.knows_place else None

        keyframe = sense_and_map(mapper, self.sense, compare, may_repeat=checked is not None)
        if belief.knows_place:
            self.correct()
        if belief.is_sure_of(MotionState.HELD):
            return Verdict.SPINNING
        # An obstacle may itself be the reason for doubt, so it comes first.
        if checked is not None and not check.is_clear(checked):
            if not belief.knows_place:
                check.forget()
            return Verdict.BLOCKED
        if not belief.knows_place:
            return Verdict.UNSURE
        if keyframe is not None and path is not None and check.meets_person(mapper.people, path):
            return Verdict.BLOCKED
        return Verdict.DONE if is_done() else Verdict.FINE

    def _move(self, command: Velocity) -> Verdict:
        """Let the robot follow a command for a control period; without odometry, stop it and raise LostError."""
        before, motion = self.navigator.motion, self.robot.drive(command)
        try:
            self.navigator.add_motion(motion)
        except LostError:
            self.robot.drive(STOP)  # Stop before anything else
            raise
        if before is not None:
            self.driven += float(np.linalg.norm((motion.T_odom_base - before.T_odom_base)[:3, 3]))
        for sink in self._sinks:
            sink.on_motion(motion)
        return Verdict.FINE

    def _remember(self, localised: LocalisedFrame) -> LocalisedFrame:
        """Remember the newest frame; LostError if the camera no longer measures anything."""
        self._last = localised.frame
        self.pose_check.check_depth(localised)
        return localised

    def sense(self) -> Frame:
        """The camera's newest frame; LostError if the camera fails twice in a row."""
        try:
            return self.robot.sense()
        except InputError:
            raise
        except Exception as error:  # Drivers raise exceptions of all kinds
            time = self.navigator.motion.time if self.navigator.motion else 0.0
            self.faults.note("camera", time, f"the camera delivered no frame: {error or type(error).__name__}")
        try:
            return self.robot.sense()
        except InputError:
            raise
        except Exception as error:
            raise LostError(f"the camera twice delivered no frame: {error or type(error).__name__}") from error
