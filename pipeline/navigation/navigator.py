"""Navigation (thesis 4.5): drive a path of way points without tipping.

The navigator commands nothing by itself: it yields one command after the other, and whoever gives them to the robot
answers with a verdict and reports each motion.
"""

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Mask, Place, Places, Pose
from pipeline.localisation.localisation import check_pose
from pipeline.navigation.attitude import Attitude
from pipeline.navigation.commands import STOP, Approach, Commands, Outcome, Turn, Verdict
from pipeline.navigation.config import NavigationConfig
from pipeline.navigation.progress import Progress
from pipeline.robot import Motion, RobotModel, Velocity
from pipeline.transforms import transform_points, wrap_angle, yaw_of

REFUSED = {Verdict.UNSURE: Outcome.UNSURE, Verdict.BLOCKED: Outcome.BLOCKED}
"""How a leg ends when the robot must not go on."""
SpeedAt = Callable[[Place, Place], float]
"""m/s, the greatest speed of a robot at a place (2,) that drives along a direction (2,)."""


@dataclass
class DrivenLeg:
    """One straight drive to a way point, for the log and the report.

    Attributes:
        target: (2,) where it led to.
        outcome: how it ended.
    """

    target: Place
    outcome: Outcome


@dataclass(frozen=True, eq=False)
class Halt:
    """A stop of the robot by something that its map does not show.

    Attributes:
        T_map_base: where the robot stopped.
        command: that the robot could not follow.
        freed: whether the robot could back out.
    """

    T_map_base: Pose
    command: Velocity
    freed: bool

    @property
    def touches(self) -> bool:
        """Whether the robot got free of an obstacle right before its leading end; in a turn it may be anywhere."""
        return self.freed and not isinstance(self.command, Turn)

    def touched(self, robot: RobotModel, cell: float) -> Places:
        """(N, 3) points right before the leading end of the robot, as high as its body, for cells of ``cell`` m."""
        # Half a cell's diagonal before the footprint, so that the cell lies outside.
        ahead = (robot.half_length + cell / np.sqrt(2)) * np.sign(self.command.v)
        across = np.linspace(-robot.half_width, robot.half_width, 2 + int(2 * robot.width / cell))
        points = [[ahead, left, robot.body_height] for left in across]
        return transform_points(self.T_map_base, np.array(points)).astype(np.float64)


class Navigator:
    """Leads a robot along way points in ``map``.

    Attributes:
        legs: every leg driven so far.
        halts: the robot's halts on the last way that it followed.
        track: (3,) m and rad in ``map``, places and headings of the robot since it began to follow that way.
        recovered: number of times so far that the robot backed out of a halt.
        motion: the newest motion of the body.
        attitude: estimate of the robot's tilt.
    """

    def __init__(self, robot: RobotModel, control_period: float, config: NavigationConfig = NavigationConfig()):
        """``control_period``: s that a command holds."""
        self.legs: list[DrivenLeg] = []
        self.halts: list[Halt] = []
        self.track: list[Place] = []
        self.recovered = 0
        self.motion: Motion | None = None
        self.attitude = Attitude(config.attitude)
        self._robot, self._period, self._config = robot, control_period, config
        self._before: Motion | None = None
        self._T_map_odom = np.eye(4)
        self._leaned_at: Place | None = None
        self._speed_limit: SpeedAt = lambda here, along: np.inf

    def correct(self, T_map_odom: Pose) -> None:
        """Go on with the newest pose of ``odom`` in ``map``, also within a drive."""
        self._T_map_odom = T_map_odom

    def moved(self, motion: Motion) -> None:
        """Take the newest motion of the body; LostError if its odometry is no pose."""
        check_pose("odometry", motion.time, motion.T_odom_base)
        self._before, self.motion = self.motion, motion
        self.attitude.update(motion.gyro, motion.accelerometer, self._period)
        if self._leans:
            self._leaned_at = self.T_map_base[:3, 3]
        self.track.append(np.append(self.T_map_base[:2, 3], yaw_of(self.T_map_base)))

    def follow(
        self,
        way_points: Places,
        heading: float | None = None,
        backwards: Mask | None = None,
        start: Place | None = None,
        speed_limit: SpeedAt = lambda here, along: np.inf,
    ) -> Commands:
        """Drive through way points; the outcome is ``REACHED`` if all of them, and the heading, were reached.

        Args:
            way_points: (N, 2), at least one.
            heading: rad, of the robot at the end; None for any.
            backwards: which of the way points the robot backs up to; None for none.
            start: (2,), where the way begins. A robot that stands elsewhere was carried and does not follow it.
            speed_limit: by the ground on the way.
        """
        self.halts, self.track, self._speed_limit = [], [], speed_limit
        yield STOP
        here = self.T_map_base[:2, 3]
        if start is not None and np.linalg.norm(here - start) > self._config.follower.carried_way:
            self.legs.append(DrivenLeg(here, Outcome.MOVED))
            return Outcome.MOVED
        backwards = np.zeros(len(way_points), np.bool_) if backwards is None else backwards
        for target, backs in zip(way_points, backwards, strict=True):
            outcome = yield from self._drive_leg(target, bool(backs))
            if outcome is not Outcome.REACHED:
                return outcome
        outcome = Outcome.REACHED
        if heading is not None:
            outcome = yield from self._supervised(self._turn_to(heading))
        if outcome is not Outcome.REACHED:
            # A turn that fails is a leg that failed.
            self.legs[-1].outcome = outcome
        return outcome

    def turn(self, angle: float) -> Commands:
        """Turn in place by an angle, rad, counter-clockwise."""
        yield STOP
        return (yield from self._supervised(self._turn_to(yaw_of(self.T_map_base) + angle)))

    def _drive_leg(self, target: Place, backwards: bool) -> Commands:
        """Turn towards the way point, or away from it, then drive straight to it."""
        T, outcome = self.T_map_base, Outcome.REACHED
        length = float(np.linalg.norm(target - T[:2, 3]))
        if length > self._config.follower.position_tolerance:
            outcome = yield from self._supervised(self._approach(T, target, backwards), length)
        self.legs.append(DrivenLeg(target, outcome))
        return outcome

    def _approach(self, T: Pose, target: Place, backwards: bool) -> Iterator[Velocity]:
        """Commands that turn the robot to the way point and drive it there."""
        # The bearing before the turn: while the robot slides in the turn, that of a near way point changes as well.
        heading = float(np.arctan2(*(target - T[:2, 3])[::-1])) + np.pi * backwards
        config = self._config.follower
        if abs(wrap_angle(heading - yaw_of(T))) > (config.pivot_ramp if self._on_ramp else config.pivot_level):
            yield from self._turn_to(heading)
        yield from self._straight_to(self.T_map_base[:2, 3].copy(), target, backwards)

    @property
    def _leans(self) -> bool:
        return self.attitude.tilt_in(0.0) > self._config.follower.lean

    @property
    def _tips(self) -> bool:
        return self.attitude.tilt_in(self._config.recovery.tilt_lead) > self._robot.tipping_tilt

    @property
    def _on_ramp(self) -> bool:
        """Whether the robot leans, or leaned near here: on the crest of a ridge it stands level."""
        at, near = self._leaned_at, self._config.follower.ramp_margin
        return at is not None and bool(np.linalg.norm(self.T_map_base[:3, 3] - at) < near)

    @property
    def _limits(self) -> tuple[float, float]:
        """Greatest speed (m/s) and turn rate (rad/s) on the ground under the robot."""
        model = self._robot
        return (model.ramp_speed, model.ramp_turn_rate) if self._on_ramp else (model.speed, model.turn_rate)

    def _turn_to(self, heading: float) -> Iterator[Velocity]:
        """Commands that turn in place, the shorter way, to a heading."""
        place, tolerance = self.T_map_base[:2, 3].copy(), self._config.follower.heading_tolerance
        while True:
            T = self.T_map_base
            error = wrap_angle(heading - yaw_of(T))
            if abs(error) < tolerance:
                return
            model, (_, fastest) = self._robot, self._limits
            # It brakes half as fast as it could, so that wheels do not skid past the heading.
            slower = np.sqrt(model.turn_acceleration * (abs(error) - tolerance))
            rate = np.clip(slower, model.min_turn_rate, fastest)
            yield Turn(self._hold(T, place, error) if self._on_ramp else 0.0, float(np.sign(error) * rate))

    def _hold(self, T: Pose, place: Place, left: float) -> float:
        """Speed (m/s) that keeps a robot at a place (2,) of a ramp while it turns by another ``left`` rad.

        It can only make up for sliding along its heading, so it makes up for the expected sliding as well. In a
        quarter turn on 16° it strays by 0.13 m at most instead of 0.21, measured.
        """
        ahead = T[:2, 0] / np.linalg.norm(T[:2, 0])
        slide = self._robot.slide_per_radian * abs(left) * T[:2, 2]
        speed = self._config.follower.hold_gain * (place - T[:2, 3] - slide) @ ahead
        return float(np.clip(speed, -self._robot.ramp_speed, self._robot.ramp_speed))

    def _straight_to(self, start: Place, target: Place, backwards: bool) -> Iterator[Velocity]:
        """Commands that follow the line from ``start`` until the robot is abreast of the target."""
        length = max(float(np.linalg.norm(target - start)), np.finfo(np.float64).eps)
        along = (target - start) / length
        left = np.array([-along[1], along[0]])
        bearing = np.arctan2(along[1], along[0]) + (np.pi if backwards else 0.0)
        model, config = self._robot, self._config.follower
        # By this gain the robot returns to the line with a damping ratio of 0.7 at full speed, and more at less.
        gain = config.turn_gain / (2 * model.speed)
        while True:
            T = self.T_map_base
            remaining = float(length - (T[:2, 3] - start) @ along)
            if remaining < config.position_tolerance:
                return
            widest = config.widest_return
            offset = float(np.clip(gain * ((T[:2, 3] - start) @ left), -widest, widest))
            error = wrap_angle(bearing - offset - yaw_of(T))
            # Slowing down before the way point keeps the wheels from skidding past it.
            slower = np.sqrt(model.acceleration * max(0.0, remaining - config.position_tolerance))
            speed = min(self._limits[0], max(model.ramp_speed / 3, slower), self._speed_limit(T[:2, 3], along))
            rate = float(np.clip(config.turn_gain * error, -model.turn_rate, model.turn_rate))
            yield Approach(-speed if backwards else speed, rate, target=target)

    def _supervised(self, commands: Iterator[Velocity], length: float = 0.0) -> Commands:
        """Yield commands until they end or must not be followed; back out if the robot leans too far or is held.

        ``length``: of the leg, m.
        """
        start = self._T_odom_base
        progress = Progress(self._robot, start, self._time, self._config.progress, length)
        for command in commands:
            verdict = yield command
            if verdict in REFUSED:
                yield STOP
                return REFUSED[verdict]
            if verdict is Verdict.FINE and self._was_carried:
                yield STOP
                return Outcome.MOVED
            leans, spins = self._tips, verdict is Verdict.SPINNING
            if leans or spins or progress.is_stuck(self._T_odom_base, self._time, command, self._on_ramp):
                T = self.T_map_base
                self.halts.append(Halt(T, command, (yield from self._back_out(start, command, leans))))
                self.recovered += self.halts[-1].freed
                return Outcome.TILTED if leans else Outcome.STUCK
        yield STOP
        return Outcome.REACHED

    @property
    def _was_carried(self) -> bool:
        """Whether the newest motion is longer than any that the robot can make by itself."""
        assert self._before is not None
        before = (self._T_map_odom @ self._before.T_odom_base)[:3, 3]
        # A real robot's time goes on while a keyframe is mapped.
        missed = max(0.0, self._time - self._before.time - self._period)
        most = self._config.follower.carried_way + missed * self._robot.speed
        return bool(np.linalg.norm(self.T_map_base[:3, 3] - before) > most)

    def _back_out(self, T_odom_start: Pose, command: Velocity, leans: bool) -> Generator[Velocity, Verdict, bool]:
        """Undo the last motion since a pose, for its way was free; True if enough of it was possible.

        A robot that leans goes back until it is level; one that backs onto something, as up a wall, comes down again.
        Wheels that spin end it: by them alone the robot would seem to go back.
        """
        model, config, T_odom_held = self._robot, self._config.recovery, self._T_odom_base
        if isinstance(command, Turn):
            most, least, braking = config.most_turn, config.least_turn, abs(command.omega) / model.turn_acceleration
            undo = Velocity(0.0, -np.sign(command.omega) * model.ramp_turn_rate)
        else:
            most, least, braking = config.most_way, config.least_way, abs(command.v) / model.acceleration
            undo = Velocity(-np.sign(command.v) * model.ramp_speed)
        came, began, progress = _way(T_odom_start, T_odom_held, undo), self._time, None
        way = np.clip(came, least, most)
        while (back := _way(self._T_odom_base, T_odom_held, undo)) < way or (leans and self._leans and back < came):
            if (yield undo) is not Verdict.FINE:
                break
            if self._tips and not leans:
                yield from self._back_out(T_odom_held, undo, leans=True)
                return False
            # Until its wheels come to rest they push on, and would seem to be held.
            if progress is None and self._time > began + braking:
                progress = Progress(model, self._T_odom_base, self._time, self._config.progress)
            if progress and progress.is_stuck(self._T_odom_base, self._time, undo, self._on_ramp):
                break
        yield STOP
        return bool(_way(self._T_odom_base, T_odom_held, undo) > way * config.enough)

    @property
    def T_map_base(self) -> Pose:
        """Pose of the robot after its newest motion."""
        assert self.motion is not None
        return self._T_map_odom @ self.motion.T_odom_base

    @property
    def _T_odom_base(self) -> Pose:
        # By the odometry, which no correction of the map moves.
        assert self.motion is not None
        return self.motion.T_odom_base

    @property
    def _time(self) -> float:
        assert self.motion is not None
        return self.motion.time


def _way(T: Pose, T_held: Pose, undo: Velocity) -> float:
    """By how many rad, or m, a pose lies behind that where the robot was held, in the direction of ``undo``."""
    if undo.omega:
        return float(np.sign(undo.omega) * wrap_angle(yaw_of(T) - yaw_of(T_held)))
    return float(np.sign(undo.v) * (T - T_held)[:3, 3] @ T_held[:3, 0])
