"""Navigation (thesis 4.5): drive along stretches without tipping.

The navigator passes its commands one by one to the caller's function ``send``. This function either lets the robot
follow the command or forbids the command, and returns a verdict.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.constants import g

from pipeline.arrays import Place, Places, Pose, Values
from pipeline.errors import required
from pipeline.localisation.localisation import check_pose
from pipeline.navigation.commands import STOP, Approach, Outcome, Send, Turn, Verdict
from pipeline.navigation.config import NavigationConfig, ProgressConfig
from pipeline.navigation.course import Course, SpeedAlong
from pipeline.planning.stretches import Stretch
from pipeline.robot import Motion, RobotModel, Velocity
from pipeline.transforms import from_yaw, inverse, transform_points, wrap_angle, yaw_of

RAMP_MARGIN = 0.2
"""Distance from the last position where the robot leaned within which it still drives as on a ramp, m, because a
robot on the crest of a ridge is level."""
PASSING_HEADING_TOLERANCE = radians(10)
"""Maximum heading error at which the robot may pass a viewpoint without a turn, rad, because its view is almost the
same."""
LEAD = 0.2
"""Time by which turn rates anticipate the curvature ahead, s, because the drive responds with a delay."""
MIN_SPEED_FACTOR = 0.2
"""Minimum factor on the robot's speed, however large the heading error."""
STILL, STILL_RATE = 0.02, 0.05
"""Speed, m/s, and turn rate, rad/s, up to which the robot is considered to stand still."""
MIN_SPEED = 0.2
"""Minimum speed assumed in the gain with which the robot steers back to its line, m/s, so that noise does not turn a
slower robot."""
MAX_RETURN_ANGLE = 0.5
"""Maximum angle between the robot's heading and its line while it returns to the line, rad."""
CARRIED_DISTANCE = 0.3
"""Displacement in one control period, or distance from the start of the plan, above which the robot is considered
carried, m."""
TILT_LEAD = 0.1
"""Time ahead for which the tilt is predicted, s; the robot backs out if it would then lean too far."""
MIN_BACK_OUT_DISTANCE, MIN_BACK_OUT_ANGLE = 0.02, radians(2)
"""Minimum distance by which the robot backs out, m, and minimum angle by which it turns back, rad."""
MIN_UNDONE_FRACTION = 0.5
"""Fraction of the intended distance or angle above which the robot is considered to have backed out."""
SPUN_DISTANCE = 0.1
"""Distance between the positions according to the camera and to the odometry above which the wheels of a robot that
backed out are considered to have spun, m."""

AVERAGING_TIME = 0.5
"""Time over which speeds are averaged to detect that something holds the robot, s."""
STILL_DISTANCE, STILL_ANGLE = 0.02, radians(2)
"""Displacement, m, and rotation, rad, up to which the robot is considered to make no progress."""
OVERDUE_RAMP = 4.0
"""Factor on the duration of a leg at ramp speed; a leg may take ``max_delay`` s longer than the product."""
MIN_V, MIN_OMEGA = 0.04, 0.15
"""Expected speed, m/s, and turn rate, rad/s, up to which the robot is never considered held."""
REACTION_TIME = 0.3
"""Time during which a robot may still follow its previous command, s, because of delays on the network and at both of
its ends. Longer intervals between two poses are ignored, because a real robot receives no command while its software
computes."""

TIME_CONSTANT = 0.5
"""Time constant, s, with which the estimated vertical follows the accelerometer, whose measurements bumps and braking
disturb."""
MAX_DISTURBANCE = 2.0
"""Maximum difference between the magnitude of an acceleration and gravity at which the acceleration is used, m/s²."""
MAX_CHANGE = radians(8)
"""Maximum predicted change of roll or pitch, rad; bumps turn the robot quickly, but not by a larger angle."""


class StuckDetector:
    """Detects that something holds the robot, or that its position and heading do not change."""

    def __init__(self, robot: RobotModel, T: Pose, time: float, config: ProgressConfig, length: float = 0.0):
        """Start at a pose and a time, s; ``length``: length of the leg, m."""
        self._limits = np.array([robot.acceleration, robot.turn_acceleration])
        self._config = config
        self._deadline = time + config.max_delay + OVERDUE_RAMP * length / robot.ramp_speed
        self._anchor = T
        self._since = time
        self._last = T
        self._time = time
        self._restart(time)

    def _restart(self, time: float) -> None:
        # (2,) forward speed and turn rate: expected from the command and the acceleration, and the averages of the
        # expected and of the measured values.
        self._expected: NDArray[np.float64] | None = None
        self._mean_expected = np.zeros(2)
        self._mean_measured = np.zeros(2)
        self._judged_from = time + REACTION_TIME
        self._unheld = time

    def is_stuck(self, T: Pose, time: float, command: Velocity, on_ramp: bool = False) -> bool:
        """Whether the newest pose shows that the robot cannot follow the command.

        On a ramp, where the wheels may skid for a moment, the robot must have been held for ``patience`` s.
        """
        config = self._config
        if (pause := time - self._time) > REACTION_TIME:
            self._since += pause
            self._deadline += pause
            self._time = time
            self._restart(time)
        if not self._is_held(T, time, command):
            self._unheld = time
        held = time - self._unheld > (config.patience if on_ramp else 0.0)
        # In a turn, wheels that spin on only one side seem to move the robot.
        moved = np.linalg.norm(T[:3, 3] - self._anchor[:3, 3]) > STILL_DISTANCE and not isinstance(command, Turn)
        turned = abs(wrap_angle(yaw_of(T) - yaw_of(self._anchor))) > STILL_ANGLE
        if moved or turned:
            self._anchor = T
            self._since = time
        self._last = T
        self._time = time
        return held or time - self._since > config.patience or time > self._deadline

    def _is_held(self, T: Pose, time: float, command: Velocity) -> bool:
        config = self._config
        dt = time - self._time
        if dt <= 0 or time < self._judged_from:
            return False
        limit = self._limits * dt
        # The speed that compensates for sliding during a turn need not move the robot.
        asked = np.array([0.0 if isinstance(command, Turn) else command.v, command.omega])
        forward = float((T[:3, 3] - self._last[:3, 3]) @ self._last[:3, 0])
        speeds = np.array([forward, wrap_angle(yaw_of(T) - yaw_of(self._last))]) / dt
        before = speeds if self._expected is None else self._expected
        self._expected = before + np.clip(asked - before, -limit, limit)
        share = min(1.0, dt / AVERAGING_TIME)
        # A robot that brakes harder than commanded is not held.
        expected = np.minimum(np.abs(self._expected), np.abs(asked)) * (self._expected * asked > 0)
        self._mean_expected += share * (expected - self._mean_expected)
        self._mean_measured += share * (speeds * np.sign(self._expected) - self._mean_measured)
        counts = self._mean_expected > (MIN_V, MIN_OMEGA)
        counts[1] &= asked[0] == 0
        return bool((counts & (self._mean_measured < config.held_fraction * self._mean_expected)).any())


class Attitude:
    """A complementary filter: the gyro rotates the estimated vertical, and the accelerometer slowly corrects it.

    Attributes:
        up: (3,) unit vector in ``base_link`` that points vertically upwards.
        rate: (2,) rates of roll and pitch, rad/s.
    """

    def __init__(self) -> None:
        self.up = np.array([0.0, 0.0, 1.0])
        self.rate = np.zeros(2)

    def update(self, gyro: NDArray[np.float64], accelerometer: NDArray[np.float64], dt: float) -> None:
        """Update with an angular velocity (3,), rad/s, and an acceleration (3,), m/s², measured over ``dt`` s.

        The acceleration includes gravity.
        """
        self.rate = gyro[:2]
        up = self.up - np.cross(gyro, self.up) * dt
        size = float(np.linalg.norm(accelerometer))
        if abs(size - g) < MAX_DISTURBANCE:
            up = up + (accelerometer / size - up) * min(1.0, dt / TIME_CONSTANT)
        self.up = up / np.linalg.norm(up)

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch, rad (REP 103: pitch is positive nose down)."""
        x, y, z = self.up
        return float(np.arctan2(y, z)), float(np.arcsin(np.clip(-x, -1, 1)))

    def tilt_in(self, seconds: float) -> float:
        """The larger magnitude of roll and pitch, rad, after ``seconds`` s at their current rates.

        The change of each angle is limited to ``MAX_CHANGE``.
        """
        most = MAX_CHANGE
        return float(np.abs(np.array(self.tilt) + np.clip(self.rate * seconds, -most, most)).max())


REFUSED = {Verdict.UNSURE: Outcome.UNSURE, Verdict.BLOCKED: Outcome.BLOCKED}
"""The outcome of a leg for each verdict that forbids the robot to continue."""


@dataclass
class DrivenLeg:
    """The drive along one stretch, for the log and the report.

    Attributes:
        target: (2,) end of the stretch in ``map``, m.
        outcome: how the drive ended.
    """

    target: Place
    outcome: Outcome


def leg_outcome(outcome: Outcome) -> Outcome:
    """The outcome of a leg, given the outcome of its drive: ``REACHED`` also if the purpose was fulfilled early."""
    return Outcome.REACHED if outcome is Outcome.DONE else outcome


class DriveDurations(NamedTuple):
    """Planned and actual durations of a drive that reached its end, s."""

    planned: float
    actual: float


@dataclass(frozen=True, eq=False)
class Halt:
    """A stop because the robot leaned too far or could not follow a command.

    Attributes:
        T_map_base: pose at which the robot stopped.
        command: the command that the robot was following.
        has_backed_out: whether the robot could back out, according to its odometry.
        backed_distance: distance by which it then backed out, according to its odometry, m; 0 after a turn.
    """

    T_map_base: Pose
    command: Velocity
    has_backed_out: bool
    backed_distance: float = 0.0

    @property
    def is_contact(self) -> bool:
        """Whether the robot backed away from an obstacle at its leading end.

        False after a turn, because the obstacle could then be anywhere.
        """
        return self.has_backed_out and not isinstance(self.command, Turn)

    def contact_points(self, robot: RobotModel, cell: float) -> Places:
        """(N, 3) m, points in ``map`` just beyond the robot's leading end, at the height of its body.

        ``cell``: side of a cell of the map to which the points will be added, m.
        """
        # The points are half a cell's diagonal beyond the footprint, so that the centres of their cells lie outside.
        ahead = (robot.half_length + cell / np.sqrt(2)) * np.sign(self.command.v)
        across = np.linspace(-robot.half_width, robot.half_width, 2 + int(2 * robot.width / cell))
        points = [[ahead, left, robot.body_height] for left in across]
        # The tilt would move points at this height into the footprint.
        x, y, z = self.T_map_base[:3, 3]
        level = from_yaw(x, y, z, yaw_of(self.T_map_base))
        return transform_points(level, np.array(points)).astype(np.float64)


class Navigator:
    """Drives a robot along stretches in ``map``.

    Attributes:
        legs: all legs driven so far.
        drive_durations: durations of all planned drives that have reached their ends.
        halts: the robot's halts since it began its newest course.
        track: (3,) x and y, m, and heading, rad, in ``map``, after each motion since the robot began its newest
            course.
        recoveries: number of halts after which the robot could back out.
        motion: the newest motion of the body.
        attitude: estimate of the robot's tilt.
    """

    def __init__(self, robot: RobotModel, control_period: float, config: NavigationConfig = NavigationConfig()):
        """Start without a motion; ``control_period``: duration of each command, s."""
        self.legs: list[DrivenLeg] = []
        self.drive_durations: list[DriveDurations] = []
        self.halts: list[Halt] = []
        self.track: list[Place] = []
        self.recoveries = 0
        self.motion: Motion | None = None
        self.attitude = Attitude()
        self._robot = robot
        self._period = control_period
        self._config = config
        self._before: Motion | None = None
        self._T_map_odom = np.eye(4)
        self._leaned_at: Place | None = None
        self._rest: Stretch | None = None  # In odom: the rest of a stretch, along which the robot is rolling

    def correct(self, T_map_odom: Pose) -> None:
        """Replace the pose of ``odom`` in ``map`` by its newest estimate, possibly during a drive."""
        self._T_map_odom = T_map_odom

    def add_motion(self, motion: Motion) -> None:
        """Process the newest motion of the body; raise LostError if its odometry is not a valid pose."""
        check_pose("odometry", motion.time, motion.T_odom_base)
        self._before = self.motion
        self.motion = motion
        self.attitude.update(motion.gyro, motion.accelerometer, self._period)
        if self._is_leaning:
            self._leaned_at = self.T_map_base[:3, 3]
        self.track.append(np.append(self.T_map_base[:2, 3], yaw_of(self.T_map_base)))

    def stopping_pose(self, T_map_base: Pose) -> Place:
        """(3,) x and y, m, and heading, rad, at which a rolling robot will stop; those of ``T_map_base`` at rest."""
        if self._rest is None:
            return np.append(T_map_base[:2, 3], yaw_of(T_map_base))
        rest = self._in_map(self._rest)
        return np.append(rest.poses[-1, :2], rest.last_heading)

    def _in_map(self, stretch: Stretch) -> Stretch:
        return stretch.moved(self._T_map_odom)

    def follow(self, course: Course, send: Send) -> Outcome:
        """Drive a course; return ``REACHED`` if its end was reached or its purpose was fulfilled early.

        A robot that is still rolling at the end comes to rest at :meth:`stopping_pose`.
        """
        began = None if self.motion is None else self._time
        outcome = self._follow(course, send)
        if outcome is Outcome.DONE:
            return Outcome.REACHED
        if outcome is Outcome.REACHED and course.planned_duration is not None and began is not None:
            self.drive_durations.append(DriveDurations(course.planned_duration, self._time - began))
        return outcome

    def _follow(self, course: Course, send: Send) -> Outcome:
        self.halts = []
        self.track = []
        way = self._with_rest(course.stretches)
        heading = course.heading
        if self._rest is None:
            self._stop(send)
        self._rest = None
        here = self.T_map_base[:2, 3]
        if self._is_elsewhere(course.start):
            self.legs.append(DrivenLeg(here, Outcome.CARRIED))
            self._stop(send)
            return Outcome.CARRIED
        if heading is not None and course.may_roll and way and self._is_nearly(way[-1].last_heading, heading):
            heading = None
        for number, stretch in enumerate(way, start=1):
            is_passed = course.may_roll and heading is None and number == len(way)
            outcome = self._drive_leg(stretch, course.speed_along, is_passed, send)
            if outcome is not Outcome.REACHED or self._rest is not None:
                return outcome
        if heading is None:
            return Outcome.REACHED
        if not way:
            self.legs.append(DrivenLeg(here, Outcome.REACHED))
        # A turn that fails makes the last leg fail.
        outcome = self._execute(self._turn_commands(heading), send)
        self.legs[-1].outcome = leg_outcome(outcome)
        return outcome

    def _is_elsewhere(self, start: Place | None) -> bool:
        """Whether the robot has been carried since its path was planned from ``start`` (2,), m."""
        here = self.T_map_base[:2, 3]
        return start is not None and bool(np.linalg.norm(here - start) > CARRIED_DISTANCE)

    def _with_rest(self, path: Sequence[Stretch]) -> list[Stretch]:
        """The stretches of a path, preceded by the stretch along which the robot is still rolling."""
        if self._rest is None:
            return list(path)
        rest = self._in_map(self._rest)
        if path and rest.leads_to(path[0], self._config.follower.pivot_level):
            return [rest.joined_with(path[0]), *path[1:]]
        return [rest, *path]

    def _is_nearly(self, heading: float, wanted: float) -> bool:
        """Whether a heading is close enough to the wanted one, both rad, that the view is almost the same."""
        return abs(wrap_angle(heading - wanted)) < PASSING_HEADING_TOLERANCE

    def halt(self, send: Send) -> Outcome:
        """Stop the robot; a rolling robot stops at the end of the stretch along which it rolls."""
        rest = self._rest
        self._rest = None
        if rest is None:
            self._stop(send)
            return Outcome.REACHED
        return self._execute(self._commands_along(self._in_map(rest), None), send)

    def _stop(self, send: Send) -> None:
        """Brake until the robot stands still, because the next plan begins where it then stands.

        On a slope, or with noisy sensors, the robot may never seem to stand still, so the wait ends once the robot
        could have braked from its top speed and turn rate.
        """
        model = self._robot
        longest = REACTION_TIME + max(model.speed / model.acceleration, model.turn_rate / model.turn_acceleration)
        for _ in range(ceil(longest / self._period)):
            send(STOP)
            twist = required(self.motion).twist
            if self._speed <= STILL and abs(twist.omega) <= STILL_RATE:
                return

    def turn(self, angle: float, send: Send) -> Outcome:
        """Turn in place by an angle, rad, counter-clockwise."""
        self.halt(send)
        return self._execute(self._turn_commands(yaw_of(self.T_map_base) + angle), send)

    def drive_back(self, send: Send) -> bool:
        """Turn to the heading of the newest halt, and drive back in the direction from which the robot came.

        Returns whether this succeeded. Without a halt, the direction is unknown, and the robot does not move.
        """
        if not self.halts:
            return False
        halt = self.halts[-1]
        ahead = 1.0 if isinstance(halt.command, Turn) else float(np.sign(halt.command.v))
        back = Velocity(-ahead * self._robot.ramp_speed)

        def commands() -> Iterator[Velocity]:
            yield from self._turn_commands(yaw_of(halt.T_map_base))
            start = self._T_odom_base
            while self._will_have_moved_back(start, back) < self._config.recovery.max_distance:
                yield back

        return self._execute(commands(), send) is Outcome.REACHED

    def is_still_held(self, T_map_odom: Pose) -> bool:
        """Whether the camera, by the newest ``T_map_odom``, shows that the robot did not back out after all.

        If wheels spin on a ramp, the odometry reports that the robot backs out, although it stays where it is.
        """
        if not self.halts or not self.halts[-1].is_contact:
            return False
        seen = (T_map_odom @ self._T_odom_base)[:3, 3]
        error = float(np.linalg.norm(seen - self.T_map_base[:3, 3]))
        return error > max(SPUN_DISTANCE, MIN_UNDONE_FRACTION * self.halts[-1].backed_distance)

    def _drive_leg(self, stretch: Stretch, speed_along: SpeedAlong | None, is_passed: bool, send: Send) -> Outcome:
        """Turn to the heading of a stretch if necessary, then drive along it."""
        speeds = None if speed_along is None else speed_along(stretch)
        outcome = self._turn_towards(stretch, send)
        if outcome is Outcome.REACHED:
            outcome = self._execute(self._commands_along(stretch, speeds, is_passed), send, stretch.length)
        self.legs.append(DrivenLeg(stretch.poses[-1, :2], leg_outcome(outcome)))
        return outcome

    def _turn_towards(self, stretch: Stretch, send: Send) -> Outcome:
        """Turn to the heading of a stretch if the heading error is too large to be corrected during the drive."""
        config = self._config.follower
        error = abs(wrap_angle(stretch.heading - yaw_of(self.T_map_base)))
        if error <= (config.pivot_ramp if self._is_on_ramp else config.pivot_level):
            return Outcome.REACHED
        outcome = self._execute(self._turn_commands(stretch.heading), send)
        _, left = stretch.offsets(self.T_map_base[:2, 3], 0)
        return Outcome.SLID if outcome is Outcome.REACHED and abs(left) > config.max_offset else outcome

    @property
    def _is_leaning(self) -> bool:
        return self.attitude.tilt_in(0.0) > self._config.follower.lean

    @property
    def _is_tipping(self) -> bool:
        return self.attitude.tilt_in(TILT_LEAD) > self._robot.tipping_tilt

    @property
    def _is_on_ramp(self) -> bool:
        """Whether the robot leans or last leaned near here, because a robot on the crest of a ridge is level."""
        at = self._leaned_at
        near = RAMP_MARGIN
        return at is not None and bool(np.linalg.norm(self.T_map_base[:3, 3] - at) < near)

    @property
    def _limits(self) -> tuple[float, float]:
        """Maximum speed, m/s, and turn rate, rad/s, on the ground under the robot."""
        model = self._robot
        return (model.ramp_speed, model.ramp_turn_rate) if self._is_on_ramp else (model.speed, model.turn_rate)

    def _turn_commands(self, heading: float) -> Iterator[Velocity]:
        """Commands that turn the robot in place to a heading, rad, in the shorter direction."""
        config = self._config.follower
        place = self.T_map_base[:2, 3].copy()
        tolerance = config.heading_tolerance
        while True:
            T = self.T_map_base
            error = wrap_angle(heading - yaw_of(T))
            if abs(error) < tolerance:
                return
            model = self._robot
            _, fastest = self._limits
            # The robot brakes less hard than it could, so that the wheels do not skid past the heading.
            slower = np.sqrt(2 * config.braking * model.turn_acceleration * (abs(error) - tolerance))
            rate = np.clip(slower, model.min_turn_rate, fastest)
            yield Turn(
                self._holding_speed(T, place, error) if self._is_on_ramp else 0.0, float(np.sign(error) * rate)
            )

    def _holding_speed(self, T: Pose, place: Place, left: float) -> float:
        """Speed, m/s, that keeps the robot at a position (2,), m, on a ramp while it turns by another ``left`` rad.

        Speed control can correct only the slide's component along the heading, so the slide expected during the rest
        of the turn is compensated for in advance. In a quarter turn on a slope of 16°, this reduces the robot's
        maximum displacement from 0.21 m to 0.13 m (measured). Slides after the next quarter turn can be corrected
        later, with another heading.
        """
        ahead = T[:2, 0] / np.linalg.norm(T[:2, 0])
        slide = self._robot.slide_per_radian * min(abs(left), np.pi / 2) * T[:2, 2]
        speed = self._config.follower.hold_gain * (place - T[:2, 3] - slide) @ ahead
        return float(np.clip(speed, -self._robot.ramp_speed, self._robot.ramp_speed))

    def _commands_along(self, stretch: Stretch, speeds: Values | None, is_passed: bool = False) -> Iterator[Velocity]:
        """Commands that follow a stretch to its end or, if ``is_passed``, until the robot must brake to stop there.

        ``speeds``: (N,) maximum speeds at the stretch's poses, m/s; None for no limit.
        """
        model = self._robot
        config = self._config.follower
        at = 0
        while True:
            T = self.T_map_base
            at = stretch.nearest(T[:2, 3], at)
            remaining, left = stretch.offsets(T[:2, 3], at)
            slowing = 2 * config.braking * model.acceleration
            if remaining < config.position_tolerance:
                return
            if is_passed and remaining <= self._braking_distance + config.position_tolerance:
                self._rest = self._braking_stretch(stretch, at)
                return
            limit = np.inf if speeds is None else float(speeds[at])
            # Slowing down before the end keeps the wheels from skidding past it.
            slower = np.sqrt(slowing * max(0.0, remaining - config.position_tolerance))
            speed = min(self._limits[0], max(model.ramp_speed / 3, slower), limit)
            yield self._steering_command(stretch, at, left, speed)

    def _steering_command(self, stretch: Stretch, at: int, left: float, speed: float) -> Approach:
        """The command, at most ``speed`` m/s fast, for a robot ``left`` m to the left of the pose of index ``at``."""
        model = self._robot
        config = self._config.follower
        # With this gain, the robot returns to its line with a damping ratio of 0.7.
        gain = config.turn_gain / (2 * max(speed, MIN_SPEED))
        back = float(np.clip(gain * left, -MAX_RETURN_ANGLE, MAX_RETURN_ANGLE))
        error = wrap_angle(stretch.poses[at, 2] - back + np.pi * stretch.backwards - yaw_of(self.T_map_base))
        # The larger the heading error, the more slowly the robot drives; otherwise, it would leave the line.
        speed *= max(MIN_SPEED_FACTOR, float(np.cos(2 * error)))
        rate = config.turn_gain * error + speed * stretch.curvature_at(at, LEAD * speed)
        rate = float(np.clip(rate, -model.turn_rate, model.turn_rate))
        return Approach(-speed if stretch.backwards else speed, rate, stretch=stretch, at=at)

    def _execute(self, commands: Iterator[Velocity], send: Send, length: float = 0.0) -> Outcome:
        """Send commands until none is left or the robot must stop; back out if the robot leans too far or is stuck.

        ``length``: length of the leg, m.
        """
        way = [self._T_odom_base]
        progress = StuckDetector(self._robot, way[0], self._time, self._config.progress, length)
        for command in commands:
            verdict = send(command)
            way.append(self._T_odom_base)
            # The caller forbids the command, or the purpose of the drive is fulfilled.
            if verdict in REFUSED:
                self._stop(send)
                return REFUSED[verdict]
            if verdict is Verdict.DONE:
                # The robot rolls on for its braking distance.
                if isinstance(command, Approach):
                    self._rest = self._braking_stretch(command.stretch, command.at)
                else:
                    self._stop(send)
                return Outcome.DONE
            if verdict is Verdict.FINE and self._was_carried:
                self._stop(send)
                return Outcome.CARRIED
            # The robot tips, its wheels spin, or it makes no progress.
            leans = self._is_tipping
            spins = verdict is Verdict.SPINNING
            if leans or spins or progress.is_stuck(self._T_odom_base, self._time, command, self._is_on_ramp):
                T, T_odom_held = self.T_map_base, self._T_odom_base
                freed = self._back_out(way, command, leans, send)
                backed = _moved_back(self._T_odom_base, T_odom_held, Velocity(-command.v)) if command.v else 0.0
                self.halts.append(Halt(T, command, freed, backed))
                self.recoveries += freed
                return Outcome.TILTED if leans else Outcome.STUCK
        if self._rest is None:
            self._stop(send)
        return Outcome.REACHED

    def _braking_stretch(self, stretch: Stretch, at: int) -> Stretch:
        """The part of a stretch, in ``odom``, from the pose of index ``at`` to the end of the braking distance."""
        brakes = stretch.distances_along[at] + self._braking_distance + self._config.follower.position_tolerance
        end = int(np.searchsorted(stretch.distances_along, brakes)) + 1
        return Stretch(stretch.poses[:end], stretch.backwards).after(at).moved(inverse(self._T_map_odom))

    @property
    def _braking_distance(self) -> float:
        """Distance that the robot needs to brake to a stop from its current speed, m."""
        return self._speed**2 / (2 * self._config.follower.braking * self._robot.acceleration)

    @property
    def _was_carried(self) -> bool:
        """Whether the newest motion is longer than the robot could have driven."""
        last = required(self._before)
        before = (self._T_map_odom @ last.T_odom_base)[:3, 3]
        # On a real robot, time passes while a keyframe is mapped.
        missed = max(0.0, self._time - last.time - self._period)
        most = CARRIED_DISTANCE + missed * self._robot.speed
        return bool(np.linalg.norm(self.T_map_base[:3, 3] - before) > most)

    def _back_out(self, T_odom_way: Sequence[Pose], command: Velocity, leans: bool, send: Send) -> bool:
        """Undo the motion along ``T_odom_way``, which was free; return whether the robot got far enough.

        A robot that leans drives back until it is level. A robot that tips while it backs out, for example up a wall,
        undoes this motion as well. The motion ends if the caller forbids the command, for example because the wheels
        spin, which the encoders alone would report as motion of the robot.
        """
        model = self._robot
        config = self._config.recovery
        T_odom_held = self._T_odom_base
        if isinstance(command, Turn):
            least, most = MIN_BACK_OUT_ANGLE, config.max_turn
            braking = abs(command.omega) / model.turn_acceleration
            undo = Velocity(0.0, -np.sign(command.omega) * model.ramp_turn_rate)
        else:
            least, most = MIN_BACK_OUT_DISTANCE, config.max_distance
            braking = abs(command.v) / model.acceleration
            undo = Velocity(-np.sign(command.v) * model.ramp_speed)
        came = sum(_moved_back(before, after, undo) for before, after in pairwise(T_odom_way))
        began = self._time
        progress = None
        way = np.clip(came, least, most)
        while (back := self._will_have_moved_back(T_odom_held, undo)) < way or (
            leans and self._is_leaning and back < came
        ):
            if send(undo) is not Verdict.FINE:
                break
            if self._is_tipping and not leans:
                self._back_out([T_odom_held, self._T_odom_base], undo, True, send)
                return False
            # While the wheels still brake the previous motion, the robot would seem to be held.
            if progress is None and self._time > began + braking:
                progress = StuckDetector(model, self._T_odom_base, self._time, self._config.progress)
            if progress and progress.is_stuck(self._T_odom_base, self._time, undo, self._is_on_ramp):
                break
        self._stop(send)
        return bool(_moved_back(self._T_odom_base, T_odom_held, undo) > way * MIN_UNDONE_FRACTION)

    def _will_have_moved_back(self, T_odom_held: Pose, undo: Velocity) -> float:
        """Angle, rad, or distance, m, that the robot has moved back by the time it rests, if it brakes now."""
        model, twist = self._robot, required(self.motion).twist
        speed, braking = np.sign(undo.v) * twist.v, model.acceleration
        if undo.omega:
            speed, braking = np.sign(undo.omega) * twist.omega, model.turn_acceleration
        rolls = max(0.0, float(speed)) ** 2 / (2 * braking)
        return _moved_back(self._T_odom_base, T_odom_held, undo) + rolls

    @property
    def T_map_base(self) -> Pose:
        """Pose of the robot after its newest motion."""
        return self._T_map_odom @ self._T_odom_base

    @property
    def _T_odom_base(self) -> Pose:
        # Odometry does not jump when the map is corrected.
        return required(self.motion).T_odom_base

    @property
    def _speed(self) -> float:
        """Speed measured by the encoders, m/s."""
        return abs(required(self.motion).twist.v)

    @property
    def _time(self) -> float:
        return required(self.motion).time


def _moved_back(T: Pose, T_held: Pose, undo: Velocity) -> float:
    """Angle, rad, or distance, m, in the direction of ``undo`` from the pose where the robot was held to ``T``."""
    if undo.omega:
        return float(np.sign(undo.omega) * wrap_angle(yaw_of(T) - yaw_of(T_held)))
    return float(np.sign(undo.v) * (T - T_held)[:3, 3] @ T_held[:3, 0])
