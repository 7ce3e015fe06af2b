"""Navigation (thesis 4.5): drive a path of way points without tipping."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from pipeline.navigation.attitude import Attitude
from pipeline.robot import Motion, Robot, Velocity
from pipeline.transforms import wrap_angle, yaw_of


@dataclass(frozen=True)
class NavigationConfig:
    """How the robot drives.

    Attributes:
        speed: on level ground, m/s (the thesis's 0.2).
        ramp_speed: climbing and descending, m/s.
        ramp_tilt: a robot that leans further is on a ramp, rad.
        crest: and so is one that did no farther from here, m.
        turn_gain: turn rate over heading error, 1/s: the wider the angle, the faster the turn.
        max_turn_rate: rad/s.
        min_turn_rate: below this the skidding wheels would not break loose, rad/s.
        heading_tolerance: a turn on the spot ends so near to its goal, rad.
        position_tolerance: a way point counts as reached so near to it, m.
        cross_track_gain: heading correction over the distance from the line, rad/m.
        max_tilt: beyond this the robot stops and backs out, rad.
        tilt_lead: it does so when it will lean that far in so many seconds.
        turn_limit: on a ramp the robot turns on the spot only if it would drive further than this off its heading, or
            off its tail, rad.
        back_limit: there it backs to a way point that is further off its heading, rad: the less it turns, the less it
            slides.
        ramp_turn_rate: of such turns, rad/s.
        ramp_slide: m that the robot slides down in such a turn, for each radian and times the sine of the tilt: 0.18
            in a quarter turn on 16°, measured.
        hold_gain: 1/s, speed at which it makes up for that over the metres that it is off its place or will be.
        hold_speed: of that at most, m/s.
        short: to a way point no farther that lies right behind it the robot backs also on level ground, m.
        right_behind: angle off its tail, rad.
        acceleration, turn_acceleration: that the drive allows itself, m/s² and rad/s²; commands come true so late.
        blocked_time: s over which speeds are averaged to notice that something holds the robot.
        blocked_share: of the commanded speed; a slower robot is held, unless it is on a ramp.
        stuck_time: s without progress after which the robot gives the leg up.
        stuck_distance: m that count as progress.
        overdue: it also gives up a turn that has taken so many seconds, or a leg that has taken so many more than
            four times what it takes at ``ramp_speed``: who slides back and forth is not still, and gets nowhere.
        jump: m; a robot that is elsewhere by this from one control period to the next was lifted.
        back_out: m that the robot backs out after it gave up.
        back_turn: rad that it turns back.
    """

    speed: float = 0.2
    ramp_speed: float = 0.15
    ramp_tilt: float = np.deg2rad(6)
    crest: float = 0.1
    turn_gain: float = 1.5
    max_turn_rate: float = 0.8
    min_turn_rate: float = 0.06
    heading_tolerance: float = np.deg2rad(2)
    position_tolerance: float = 0.04
    cross_track_gain: float = 1.5
    max_tilt: float = np.deg2rad(25)
    tilt_lead: float = 0.1
    turn_limit: float = np.deg2rad(35)
    back_limit: float = np.deg2rad(90)
    ramp_turn_rate: float = 0.4
    ramp_slide: float = 0.42
    hold_gain: float = 1.0
    hold_speed: float = 0.1
    short: float = 0.8
    right_behind: float = np.deg2rad(10)
    acceleration: float = 0.3
    turn_acceleration: float = np.deg2rad(100)
    blocked_time: float = 0.5
    blocked_share: float = 0.35
    stuck_time: float = 4.0
    stuck_distance: float = 0.02
    overdue: float = 60.0
    jump: float = 0.15
    back_out: float = 0.3
    back_turn: float = np.deg2rad(20)


class Outcome(Enum):
    """How a leg ended."""

    REACHED = "reached"
    STUCK = "stuck"
    TILTED = "tilted"
    BLOCKED = "blocked"
    """Something stands in the way that the map does not show."""
    MOVED = "moved"
    """The robot was lifted and set down elsewhere."""


@dataclass(frozen=True)
class Turn(Velocity):
    """A command to turn in place; ``v`` only makes up for sliding down a ramp meanwhile."""


@dataclass
class Leg:
    """One straight drive to a way point, for the log and the report.

    Attributes:
        target: (2,) m in ``map``.
        outcome: how it ended.
        duration: s.
    """

    target: NDArray[np.float64]
    outcome: Outcome
    duration: float


@dataclass(frozen=True, eq=False)
class Halt:
    """Something stopped the robot that its map does not show.

    Attributes:
        T_map_base: 4×4 pose where it stopped.
        command: that it could not follow.
        freed: whether the robot got away from there.
    """

    T_map_base: NDArray[np.float64]
    command: Velocity
    freed: bool

    @property
    def touches(self) -> bool:
        """Whether what stopped the robot stands right before the end that went ahead; of turns nobody knows."""
        return self.freed and not isinstance(self.command, Turn)


class _Progress:
    """Notices when the robot is held, and when nothing moves any more, neither the position nor the heading."""

    def __init__(self, config: NavigationConfig, T: NDArray[np.float64], time: float, length: float = 0.0):
        """``length``: of the leg, m."""
        self._config = config
        self._deadline = time + config.overdue + 4 * length / config.ramp_speed
        self._anchor, self._since = T, time
        self._last, self._time = T, time
        # Speeds forward and of turning: as commanded and so far come true, and the averages of what is and should be.
        self._due, self._wanted, self._felt = np.zeros(2), np.zeros(2), np.zeros(2)

    def is_stuck(self, T: NDArray[np.float64], time: float, command: Velocity, on_ramp: bool = False) -> bool:
        """Whether the newest pose shows that the command cannot be followed; on ramps the wheels skid for a while."""
        held = self._is_held(T, time - self._time, command) and not on_ramp
        moved = np.linalg.norm(T[:3, 3] - self._anchor[:3, 3]) > self._config.stuck_distance
        turned = abs(wrap_angle(yaw_of(T) - yaw_of(self._anchor))) > np.deg2rad(3)
        if moved or turned:
            self._anchor, self._since = T, time
        self._last, self._time = T, time
        return held or time - self._since > self._config.stuck_time or time > self._deadline

    def _is_held(self, T: NDArray[np.float64], dt: float, command: Velocity) -> bool:
        config = self._config
        if dt <= 0:
            return False
        limit = np.array([config.acceleration, config.turn_acceleration]) * dt
        # What a turn makes up for sliding is no way to be made.
        v = 0.0 if isinstance(command, Turn) else command.v
        self._due += np.clip([v, command.omega] - self._due, -limit, limit)
        forward = float((T[:3, 3] - self._last[:3, 3]) @ self._last[:3, 0])
        speeds = np.array([forward, wrap_angle(yaw_of(T) - yaw_of(self._last))]) / dt
        share = min(1.0, dt / config.blocked_time)
        self._wanted += share * (np.abs(self._due) - self._wanted)
        self._felt += share * (speeds * np.sign(self._due) - self._felt)
        counts = self._wanted > (0.04, 0.15)
        counts[1] &= v == 0
        return bool((counts & (self._felt < config.blocked_share * self._wanted)).any())


IsClear = Callable[[NDArray[np.float64], NDArray[np.float64]], bool]
"""Whether nothing stands between a robot at a place (2,) and the way point (2,) that it drives straight to."""


@dataclass
class Navigator:
    """Drives a :class:`Robot` along way points in ``map``.

    Attributes:
        robot: the body.
        T_map_odom: 4×4, where the localisation believes the odometry's origin.
        legs: every leg driven so far.
        halts: what stopped the robot on the last way that it followed.
        track: (2,) m in ``map``, where the robot has been since it began to follow that way.
        recovered: how often it got away from what held it, so far.
        motion: the newest motion of the body.
        attitude: how far the robot leans.
    """

    robot: Robot
    config: NavigationConfig = field(default_factory=NavigationConfig)
    T_map_odom: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    legs: list[Leg] = field(default_factory=list)
    halts: list[Halt] = field(default_factory=list)
    track: list[NDArray[np.float64]] = field(default_factory=list)
    recovered: int = 0
    motion: Motion | None = None
    attitude: Attitude = field(default_factory=Attitude)
    _leaned_at: NDArray[np.float64] | None = field(default=None, init=False)

    def follow(
        self,
        way_points: NDArray[np.float64],
        heading: float | None = None,
        back_up: bool | None = None,
        start: NDArray[np.float64] | None = None,
        is_clear: IsClear = lambda position, target: True,
    ) -> bool:
        """Drive through way points; True if all was reached.

        Args:
            way_points: (N, 2 or 3) m in ``map``, at least one.
            heading: rad, in which the robot looks at the end.
            back_up: whether to drive to the last way point backwards; None if either will do.
            start: (2,) m, where the way begins. A robot that stands elsewhere was lifted and does not follow it.
            is_clear: asked while the robot drives forward, not in turns; it stops where the answer is no.
        """
        self.halts, self.track = [], []
        here = self._drive(Velocity())[:2, 3]
        if start is not None and np.linalg.norm(here - start) > self.config.jump:
            self.legs.append(Leg(way_points[0][:2], Outcome.MOVED, 0.0))
            return False
        for n, target in enumerate(way_points, start=1):
            if not self._drive_leg(
                np.asarray(target)[:2], back_up if n == len(way_points) else None, is_clear
            ):
                return False
        return heading is None or self._look_along(heading)

    def _look_along(self, heading: float) -> bool:
        """Turn to the heading at the last way point; a turn that fails is a leg that failed."""
        outcome = self._finish(self._turn_to(heading))
        if outcome is not Outcome.REACHED and self.legs:
            self.legs[-1].outcome = outcome
        return outcome is Outcome.REACHED

    def _drive_leg(self, target: NDArray[np.float64], back_up: bool | None, is_clear: IsClear) -> bool:
        """Turn towards the way point, or away from it, then drive straight to it."""
        T, started = self.T_map_base, self._time
        outcome = Outcome.REACHED
        length = float(np.linalg.norm(target - T[:2, 3]))
        if length > self.config.position_tolerance:
            commands = self._approach(T, target, back_up)
            outcome = self._finish(commands, lambda here: is_clear(here, target), length)
        self.legs.append(Leg(target, outcome, self._time - started))
        return outcome is Outcome.REACHED

    def _approach(
        self, T: NDArray[np.float64], target: NDArray[np.float64], back_up: bool | None
    ) -> Iterator[Velocity]:
        """Commands that bring the robot to the way point; if it may, it backs rather than turn around."""
        on_ramp = self._on_ramp
        backwards = self._should_back(T, target, on_ramp) if back_up is None else back_up
        # Not from where it slides to in the turn: the bearing of a way point that is near would turn as well.
        heading = _bearing(T[:2, 3], target) + np.pi * backwards
        if not on_ramp or abs(wrap_angle(heading - yaw_of(T))) > self.config.turn_limit:
            yield from self._turn_to(heading)
        yield from self._straight_to(self.T_map_base[:2, 3].copy(), target, backwards)

    def _should_back(self, T: NDArray[np.float64], target: NDArray[np.float64], on_ramp: bool) -> bool:
        """Whether to back to a way point that may be met either way."""
        config, error = self.config, abs(wrap_angle(_bearing(T[:2, 3], target) - yaw_of(T)))
        is_short = bool(np.linalg.norm(target - T[:2, 3]) <= config.short)
        return error > config.back_limit if on_ramp else is_short and error > np.pi - config.right_behind

    @property
    def _on_ramp(self) -> bool:
        """Whether the robot leans, or did right before: on the crest of a ridge it stands level."""
        return self._leaned_at is not None and bool(
            np.linalg.norm(self.T_map_base[:3, 3] - self._leaned_at) < self.config.crest
        )

    def _turn_to(self, heading: float) -> Iterator[Velocity]:
        """Commands that turn on the spot, the shorter way, to a heading."""
        config, place = self.config, self.T_map_base[:2, 3].copy()
        while True:
            T = self.T_map_base
            error = wrap_angle(heading - yaw_of(T))
            if abs(error) < config.heading_tolerance:
                return
            fastest = config.ramp_turn_rate if self._on_ramp else config.max_turn_rate
            rate = np.clip(config.turn_gain * abs(error), config.min_turn_rate, fastest)
            yield Turn(self._hold(T, place, error) if self._on_ramp else 0.0, float(np.sign(error) * rate))

    def _hold(self, T: NDArray[np.float64], place: NDArray[np.float64], left: float) -> float:
        """Speed (m/s) that keeps a robot at a place (2,) of a ramp while it turns by what is ``left``, rad.

        It can only make up for what it slides along its heading, so it does so ahead of time as well. In a quarter
        turn on 16° it strays by 0.13 m at most instead of 0.21, measured.
        """
        config, ahead = self.config, T[:2, 0] / np.linalg.norm(T[:2, 0])
        slide = config.ramp_slide * abs(left) * T[:2, 2]
        speed = config.hold_gain * (place - T[:2, 3] - slide) @ ahead
        return float(np.clip(speed, -config.hold_speed, config.hold_speed))

    def _straight_to(
        self, start: NDArray[np.float64], target: NDArray[np.float64], backwards: bool
    ) -> Iterator[Velocity]:
        """Commands that follow the line from ``start`` until the robot is abreast of the target."""
        config = self.config
        length = max(float(np.linalg.norm(target - start)), 1e-6)
        along = (target - start) / length
        left = np.array([-along[1], along[0]])
        bearing = np.arctan2(along[1], along[0]) + (np.pi if backwards else 0.0)
        while True:
            T = self.T_map_base
            remaining = float(length - (T[:2, 3] - start) @ along)
            if remaining < config.position_tolerance:
                return
            offset = float(np.clip(config.cross_track_gain * ((T[:2, 3] - start) @ left), -0.5, 0.5))
            error = wrap_angle(bearing - offset - yaw_of(T))
            # Slowing down before the way point keeps the wheels from skidding past it.
            speed = min(config.ramp_speed if self._on_ramp else config.speed, max(0.05, remaining))
            rate = float(np.clip(config.turn_gain * error, -config.max_turn_rate, config.max_turn_rate))
            yield Velocity(-speed if backwards else speed, rate)

    def _finish(
        self,
        commands: Iterator[Velocity],
        is_clear: Callable[[NDArray[np.float64]], bool] = lambda here: True,
        length: float = 0.0,
    ) -> Outcome:
        """Give commands until they end or something stands ahead; a robot that leans too far or is held backs out."""
        progress = _Progress(self.config, self.T_map_base, self._time, length)
        for command in commands:
            if command.v > 0 and not isinstance(command, Turn) and not is_clear(self.T_map_base[:2, 3]):
                self._drive(Velocity())
                return Outcome.BLOCKED
            before, T = self.T_map_base, self._drive(command)
            if np.linalg.norm(T[:3, 3] - before[:3, 3]) > self.config.jump:
                self._drive(Velocity())
                return Outcome.MOVED
            leans = self.attitude.tilt_in(self.config.tilt_lead) > self.config.max_tilt
            if leans or progress.is_stuck(T, self._time, command, self._on_ramp):
                self._back_out(command)
                self.halts.append(Halt(T, command, self._came_away(T, command)))
                self.recovered += self.halts[-1].freed
                return Outcome.TILTED if leans else Outcome.STUCK
        self._drive(Velocity())
        return Outcome.REACHED

    def _back_out(self, command: Velocity) -> None:
        """Undo the last of the motion: that way was free."""
        config = self.config
        if isinstance(command, Turn):
            undo, seconds = Velocity(0.0, -np.sign(command.omega) * config.ramp_turn_rate), config.back_turn
            seconds /= config.ramp_turn_rate
        else:
            undo, seconds = (
                Velocity(-np.sign(command.v) * config.ramp_speed),
                config.back_out / config.ramp_speed,
            )
        T = self._drive(Velocity())
        progress = _Progress(config, T, self._time)
        for _ in range(round(seconds / self.robot.control_period)):
            if progress.is_stuck(self._drive(undo), self._time, undo, self._on_ramp):
                break
        self._drive(Velocity())

    def _came_away(self, T: NDArray[np.float64], command: Velocity) -> bool:
        """Whether the robot has undone most of what it should have from the pose where it was held."""
        if isinstance(command, Turn):
            return bool(abs(wrap_angle(yaw_of(self.T_map_base) - yaw_of(T))) > self.config.back_turn / 2)
        return bool(np.linalg.norm(self.T_map_base[:3, 3] - T[:3, 3]) > self.config.back_out / 2)

    def _drive(self, command: Velocity) -> NDArray[np.float64]:
        self.motion = self.robot.drive(command)
        self.attitude.update(self.motion.gyro, self.motion.accelerometer, self.robot.control_period)
        if self.attitude.tilt_in(0.0) > self.config.ramp_tilt:
            self._leaned_at = self.T_map_base[:3, 3]
        self.track.append(self.T_map_base[:2, 3])
        return self.T_map_base

    @property
    def T_map_base(self) -> NDArray[np.float64]:
        """4×4 pose of the robot after its newest motion."""
        assert self.motion is not None
        return self.T_map_odom @ self.motion.T_odom_base

    @property
    def _time(self) -> float:
        assert self.motion is not None
        return self.motion.time


def _bearing(start: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    return float(np.arctan2(target[1] - start[1], target[0] - start[0]))
