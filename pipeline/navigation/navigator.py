"""Navigation (thesis 4.5): drive a path of way points without tipping."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.elevation_map import CELL
from pipeline.elevation_map.traversability import RAMP_MARGIN
from pipeline.labels import RAMP_TILT
from pipeline.localisation.localisation import (
    KEYFRAME_TURN,
    KEYFRAME_WAY,
    STILL_TURN,
    STILL_WAY,
    LostError,
    check_pose,
)
from pipeline.navigation.attitude import Attitude
from pipeline.navigation.progress import Progress, Turn
from pipeline.robot import Motion, Robot, RobotModel, Velocity
from pipeline.transforms import transform_points, wrap_angle, yaw_of

LEAN = RAMP_TILT - STILL_TURN
"""rad; a robot that leans more is on a ramp, even if only its first wheels are."""
TURN_GAIN = 1.5
"""1/s, turn rate over heading error: the wider the angle, the faster the turn (thesis 4.5)."""
POSITION_TOLERANCE = 0.04
"""m; a way point counts as reached this close to it."""
TILT_LEAD = 0.1
"""s; the robot backs out if it will lean too far within this time."""
TURN_LIMIT = np.deg2rad(35)
"""rad; on a ramp the robot turns in place only if the way deviates more than this from its heading, or its tail."""
SWERVE = np.deg2rad(5)
"""rad; the same on level ground: smaller deviations are corrected on the way."""


class Outcome(Enum):
    """How a leg ended."""

    REACHED = "reached"
    STUCK = "stuck"
    TILTED = "tilted"
    BLOCKED = "blocked"
    """An obstacle that the map does not show stands in the way."""
    MOVED = "carried elsewhere"
    UNSURE = "pose in doubt, so the robot looks around"


@dataclass
class DrivenLeg:
    """One straight drive to a way point, for the log and the report.

    Attributes:
        target: (2,) m in ``map``.
        outcome: how it ended.
    """

    target: NDArray[np.float64]
    outcome: Outcome


@dataclass(frozen=True, eq=False)
class Halt:
    """A stop of the robot by something that its map does not show.

    Attributes:
        T_map_base: 4×4 pose where the robot stopped.
        command: that the robot could not follow.
        freed: whether the robot could back out.
    """

    T_map_base: NDArray[np.float64]
    command: Velocity
    freed: bool

    @property
    def touches(self) -> bool:
        """Whether the robot got free of an obstacle right before its leading end; in a turn it may be anywhere."""
        return self.freed and not isinstance(self.command, Turn)

    def touched(self, robot: RobotModel) -> NDArray[np.float64]:
        """(N, 3) points in ``map`` right before the leading end of the robot, as high as its body, m."""
        # Half a cell's diagonal before the footprint, so that the cell lies outside.
        ahead = (robot.half_length + CELL / np.sqrt(2)) * np.sign(self.command.v)
        across = np.linspace(-robot.half_width, robot.half_width, 2 + int(2 * robot.width / CELL))
        points = [[ahead, left, robot.body_height] for left in across]
        return transform_points(self.T_map_base, np.array(points)).astype(np.float64)


IsClear = Callable[[NDArray[np.float64], NDArray[np.float64]], bool]
"""Whether no obstacle stands between a robot at a place (2,) and the way point (2,) that it drives straight to."""
SpeedAt = Callable[[NDArray[np.float64], NDArray[np.float64]], float]
"""m/s, the greatest speed of a robot at a place (2,) that drives along a unit vector (2,)."""


class MotionCheck(Enum):
    """What a look around says of the robot's motion."""

    FINE = "it moves as the odometry says"
    SPINNING = "its wheels turn and it stays"
    UNSURE = "its pose is in doubt"


@dataclass
class Navigator:
    """Drives a :class:`Robot` along way points in ``map``.

    Attributes:
        robot: the body.
        hold_gain: 1/s, speed over the present and expected slide in a turn on a ramp; 0 for wheels that do not slide.
        on_motion: called with every motion of the body.
        legs: every leg driven so far.
        halts: the robot's halts on the last way that it followed.
        track: (3,) m and rad in ``map``, places and headings of the robot since it began to follow that way.
        recovered: number of times so far that the robot backed out of a halt.
        motion: the newest motion of the body.
        attitude: estimate of the robot's tilt.
    """

    robot: Robot
    hold_gain: float = 1.0
    on_motion: Callable[[Motion], object] = lambda motion: None
    legs: list[DrivenLeg] = field(default_factory=list)
    halts: list[Halt] = field(default_factory=list)
    track: list[NDArray[np.float64]] = field(default_factory=list)
    recovered: int = 0
    motion: Motion | None = None
    attitude: Attitude = field(default_factory=Attitude)
    _T_map_odom: NDArray[np.float64] = field(default_factory=lambda: np.eye(4), init=False)
    _leaned_at: NDArray[np.float64] | None = field(default=None, init=False)
    _look: Callable[[], MotionCheck] = field(init=False)
    _speed_limit: SpeedAt = field(init=False)

    def correct(self, T_map_odom: NDArray[np.float64]) -> None:
        """Go on with the newest 4×4 pose of ``odom`` in ``map``, also within a drive."""
        self._T_map_odom = T_map_odom

    def follow(
        self,
        way_points: NDArray[np.float64],
        heading: float | None = None,
        backwards: NDArray[np.bool_] | None = None,
        start: NDArray[np.float64] | None = None,
        is_clear: IsClear = lambda position, target: True,
        speed_limit: SpeedAt = lambda here, along: np.inf,
        look: Callable[[], MotionCheck] = lambda: MotionCheck.FINE,
    ) -> bool:
        """Drive through way points; True if all of them, and the heading, were reached.

        Args:
            way_points: (N, 2) m in ``map``, at least one.
            heading: rad, of the robot at the end; None for any.
            backwards: (N,) which of the way points the robot backs up to; None for none.
            start: (2,) m, where the way begins. A robot that stands elsewhere was kidnapped and does not follow it.
            is_clear: called while the robot drives forward, not in turns; it stops if the result is False.
            speed_limit: by the ground on the way.
            look: called before each command; it may :meth:`correct` the pose.
        """
        self.halts, self.track, self._speed_limit, self._look = [], [], speed_limit, look
        here = self._drive(Velocity())[:2, 3]
        if start is not None and np.linalg.norm(here - start) > KEYFRAME_WAY:
            self.legs.append(DrivenLeg(here, Outcome.MOVED))
            return False
        backwards = np.zeros(len(way_points), np.bool_) if backwards is None else backwards
        for target, backs in zip(way_points, backwards, strict=True):
            if not self._drive_leg(target, bool(backs), is_clear):
                return False
        outcome = Outcome.REACHED if heading is None else self._finish(self._turn_to(heading))
        if outcome is not Outcome.REACHED:
            # A turn that fails is a leg that failed.
            self.legs[-1].outcome = outcome
        return outcome is Outcome.REACHED

    def turn(self, angle: float) -> bool:
        """Turn in place by an angle, rad, counter-clockwise; True if it was possible."""
        self._look = lambda: MotionCheck.FINE
        self._drive(Velocity())
        return self._finish(self._turn_to(yaw_of(self.T_map_base) + angle)) is Outcome.REACHED

    def _drive_leg(self, target: NDArray[np.float64], backwards: bool, is_clear: IsClear) -> bool:
        """Turn towards the way point, or away from it, then drive straight to it."""
        T, outcome = self.T_map_base, Outcome.REACHED
        length = float(np.linalg.norm(target - T[:2, 3]))
        if length > POSITION_TOLERANCE:
            commands = self._approach(T, target, backwards)
            outcome = self._finish(commands, lambda here: is_clear(here, target), length)
        self.legs.append(DrivenLeg(target, outcome))
        return outcome is Outcome.REACHED

    def _approach(self, T: NDArray[np.float64], target: NDArray[np.float64], backwards: bool) -> Iterator[Velocity]:
        """Commands that turn the robot to the way point and drive it there."""
        # The bearing before the turn: while the robot slides in the turn, that of a near way point changes as well.
        heading = float(np.arctan2(*(target - T[:2, 3])[::-1])) + np.pi * backwards
        if abs(wrap_angle(heading - yaw_of(T))) > (TURN_LIMIT if self._on_ramp else SWERVE):
            yield from self._turn_to(heading)
        yield from self._straight_to(self.T_map_base[:2, 3].copy(), target, backwards)

    @property
    def _leans(self) -> bool:
        return self.attitude.tilt_in(0.0) > LEAN

    @property
    def _tips(self) -> bool:
        return self.attitude.tilt_in(TILT_LEAD) > self.robot.model.tipping_tilt

    @property
    def _on_ramp(self) -> bool:
        """Whether the robot leans, or leaned within ``RAMP_MARGIN``: on the crest of a ridge it stands level."""
        return self._leaned_at is not None and bool(
            np.linalg.norm(self.T_map_base[:3, 3] - self._leaned_at) < RAMP_MARGIN
        )

    @property
    def _limits(self) -> tuple[float, float]:
        """Greatest speed (m/s) and turn rate (rad/s) on the ground under the robot."""
        model = self.robot.model
        return (model.ramp_speed, model.ramp_turn_rate) if self._on_ramp else (model.speed, model.turn_rate)

    def _turn_to(self, heading: float) -> Iterator[Velocity]:
        """Commands that turn in place, the shorter way, to a heading."""
        place = self.T_map_base[:2, 3].copy()
        while True:
            T = self.T_map_base
            error = wrap_angle(heading - yaw_of(T))
            if abs(error) < STILL_TURN:
                return
            model, (_, fastest) = self.robot.model, self._limits
            # It brakes half as fast as it could, so that wheels do not skid past the heading.
            slower = np.sqrt(model.turn_acceleration * (abs(error) - STILL_TURN))
            rate = np.clip(slower, model.min_turn_rate, fastest)
            yield Turn(self._hold(T, place, error) if self._on_ramp else 0.0, float(np.sign(error) * rate))

    def _hold(self, T: NDArray[np.float64], place: NDArray[np.float64], left: float) -> float:
        """Speed (m/s) that keeps a robot at a place (2,) of a ramp while it turns by another ``left`` rad.

        It can only make up for sliding along its heading, so it makes up for the expected sliding as well. In a
        quarter turn on 16° it strays by 0.13 m at most instead of 0.21, measured.
        """
        ahead = T[:2, 0] / np.linalg.norm(T[:2, 0])
        slide = self.robot.model.slide_per_radian * abs(left) * T[:2, 2]
        speed = self.hold_gain * (place - T[:2, 3] - slide) @ ahead
        return float(np.clip(speed, -self.robot.model.ramp_speed, self.robot.model.ramp_speed))

    def _straight_to(
        self, start: NDArray[np.float64], target: NDArray[np.float64], backwards: bool
    ) -> Iterator[Velocity]:
        """Commands that follow the line from ``start`` until the robot is abreast of the target."""
        length = max(float(np.linalg.norm(target - start)), np.finfo(np.float64).eps)
        along = (target - start) / length
        left = np.array([-along[1], along[0]])
        bearing = np.arctan2(along[1], along[0]) + (np.pi if backwards else 0.0)
        model = self.robot.model
        # By this gain the robot returns to the line with a damping ratio of 0.7 at full speed, and more at less.
        gain = TURN_GAIN / (2 * model.speed)
        while True:
            T = self.T_map_base
            remaining = float(length - (T[:2, 3] - start) @ along)
            if remaining < POSITION_TOLERANCE:
                return
            offset = float(np.clip(gain * ((T[:2, 3] - start) @ left), -0.5, 0.5))
            error = wrap_angle(bearing - offset - yaw_of(T))
            # Slowing down before the way point keeps the wheels from skidding past it.
            slower = np.sqrt(model.acceleration * max(0.0, remaining - POSITION_TOLERANCE))
            speed = min(self._limits[0], max(model.ramp_speed / 3, slower), self._speed_limit(T[:2, 3], along))
            rate = float(np.clip(TURN_GAIN * error, -model.turn_rate, model.turn_rate))
            yield Velocity(-speed if backwards else speed, rate)

    def _finish(
        self,
        commands: Iterator[Velocity],
        is_clear: Callable[[NDArray[np.float64]], bool] = lambda here: True,
        length: float = 0.0,
    ) -> Outcome:
        """Give commands until they end or an obstacle is ahead; back out if the robot leans too far or is held."""
        start = self._T_odom_base
        progress = Progress(self.robot.model, start, self._time, length)
        for command in commands:
            look = self._look()
            if look is MotionCheck.UNSURE:
                self._drive(Velocity())
                return Outcome.UNSURE
            if command.v > 0 and not isinstance(command, Turn) and not is_clear(self.T_map_base[:2, 3]):
                self._drive(Velocity())
                return Outcome.BLOCKED
            before, time, T = self.T_map_base, self._time, self._drive(command)
            # A real robot's time goes on while a keyframe is mapped.
            missed = max(0.0, self._time - time - self.robot.control_period)
            if np.linalg.norm(T[:3, 3] - before[:3, 3]) > KEYFRAME_WAY + missed * self.robot.model.speed:
                self._drive(Velocity())
                return Outcome.MOVED
            leans = self._tips
            is_stuck = progress.is_stuck(self._T_odom_base, self._time, command, self._on_ramp)
            if leans or look is MotionCheck.SPINNING or is_stuck:
                self.halts.append(Halt(T, command, self._back_out(start, command, leans)))
                self.recovered += self.halts[-1].freed
                return Outcome.TILTED if leans else Outcome.STUCK
        self._drive(Velocity())
        return Outcome.REACHED

    def _back_out(self, T_odom_start: NDArray[np.float64], command: Velocity, leans: bool) -> bool:
        """Undo the last motion since a 4×4 pose, for its way was free; True if more than half of it was possible.

        A robot that leans goes back until it is level; one that backs onto something, as up a wall, comes down again.
        Wheels that spin end it: by them alone the robot would seem to go back.
        """
        model, turns, T_odom_held = self.robot.model, isinstance(command, Turn), self._T_odom_base
        if turns:
            most, least, braking = KEYFRAME_TURN, STILL_TURN, abs(command.omega) / model.turn_acceleration
            undo = Velocity(0.0, -np.sign(command.omega) * model.ramp_turn_rate)
        else:
            most, least, braking = KEYFRAME_WAY, STILL_WAY, abs(command.v) / model.acceleration
            undo = Velocity(-np.sign(command.v) * model.ramp_speed)
        came, began, progress = _way(T_odom_start, T_odom_held, undo), self._time, None
        way = np.clip(came, least, most)
        while (back := _way(self._T_odom_base, T_odom_held, undo)) < way or (leans and self._leans and back < came):
            if self._look() is not MotionCheck.FINE:
                break
            self._drive(undo)
            if self._tips and not leans:
                self._back_out(T_odom_held, undo, leans=True)
                return False
            # Until its wheels come to rest they push on, and would seem to be held.
            if progress is None and self._time > began + braking:
                progress = Progress(model, self._T_odom_base, self._time)
            if progress and progress.is_stuck(self._T_odom_base, self._time, undo, self._on_ramp):
                break
        self._drive(Velocity())
        return bool(_way(self._T_odom_base, T_odom_held, undo) > way / 2)

    def _drive(self, command: Velocity) -> NDArray[np.float64]:
        """Drive for a control period: the 4×4 pose in ``map`` then; LostError, at a standstill, without odometry."""
        motion = self.robot.drive(command)
        try:
            check_pose("odometry", motion.time, motion.T_odom_base)
        except LostError:
            self.robot.drive(Velocity())  # stand, before anything else
            raise
        self.motion = motion
        self.on_motion(motion)
        self.attitude.update(self.motion.gyro, self.motion.accelerometer, self.robot.control_period)
        if self._leans:
            self._leaned_at = self.T_map_base[:3, 3]
        self.track.append(np.append(self.T_map_base[:2, 3], yaw_of(self.T_map_base)))
        return self.T_map_base

    @property
    def T_map_base(self) -> NDArray[np.float64]:
        """4×4 pose of the robot after its newest motion."""
        assert self.motion is not None
        return self._T_map_odom @ self.motion.T_odom_base

    @property
    def _T_odom_base(self) -> NDArray[np.float64]:
        # By the odometry, which no correction of the map moves.
        assert self.motion is not None
        return self.motion.T_odom_base

    @property
    def _time(self) -> float:
        assert self.motion is not None
        return self.motion.time


def _way(T: NDArray[np.float64], T_held: NDArray[np.float64], undo: Velocity) -> float:
    """By how many rad, or m, a 4×4 pose lies behind that where the robot was held, in the direction of ``undo``."""
    if undo.omega:
        return float(np.sign(undo.omega) * wrap_angle(yaw_of(T) - yaw_of(T_held)))
    return float(np.sign(undo.v) * (T - T_held)[:3, 3] @ T_held[:3, 0])
