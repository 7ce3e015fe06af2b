"""Navigation (thesis 4.5): drive a path of way points without tipping."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from pipeline.robot import Motion, Robot, Velocity
from pipeline.transforms import tilt_of, wrap_angle, yaw_of


@dataclass(frozen=True)
class NavigationConfig:
    """How the robot drives.

    Attributes:
        speed: on level ground, m/s (the thesis's 0.2).
        ramp_speed: climbing and descending, m/s.
        ramp_tilt: a robot that leans further is on a ramp, rad.
        turn_gain: turn rate over heading error, 1/s: the wider the angle, the faster the turn.
        max_turn_rate: rad/s.
        min_turn_rate: below this the skidding wheels would not break loose, rad/s.
        heading_tolerance: a turn on the spot ends so near to its goal, rad.
        position_tolerance: a way point counts as reached so near to it, m.
        cross_track_gain: heading correction over the distance from the line, rad/m.
        max_tilt: beyond this the robot stops and backs out, rad.
        stuck_time: s without progress after which the robot gives the leg up.
        stuck_distance: m that count as progress.
        back_out: m that the robot backs out after it gave up.
    """

    speed: float = 0.2
    ramp_speed: float = 0.15
    ramp_tilt: float = np.deg2rad(6)
    turn_gain: float = 1.5
    max_turn_rate: float = 0.8
    min_turn_rate: float = 0.06
    heading_tolerance: float = np.deg2rad(2)
    position_tolerance: float = 0.04
    cross_track_gain: float = 1.5
    max_tilt: float = np.deg2rad(25)
    stuck_time: float = 4.0
    stuck_distance: float = 0.02
    back_out: float = 0.3


class Outcome(Enum):
    """How a leg ended."""

    REACHED = "reached"
    STUCK = "stuck"
    TILTED = "tilted"


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


@dataclass
class _Progress:
    """Notices when nothing moves any more, neither the position nor the heading."""

    config: NavigationConfig
    anchor: NDArray[np.float64] | None = None
    since: float = 0.0

    def is_stuck(self, T: NDArray[np.float64], time: float) -> bool:
        moved = (
            self.anchor is None or np.linalg.norm(T[:3, 3] - self.anchor[:3, 3]) > self.config.stuck_distance
        )
        turned = self.anchor is None or abs(wrap_angle(yaw_of(T) - yaw_of(self.anchor))) > np.deg2rad(3)
        if moved or turned:
            self.anchor, self.since = T.copy(), time
        return time - self.since > self.config.stuck_time


@dataclass
class Navigator:
    """Drives a :class:`Robot` along way points in ``map``.

    Attributes:
        robot: the body.
        T_map_odom: 4×4, where the localisation believes the odometry's origin.
        legs: every leg driven so far.
        motion: the newest motion of the body.
    """

    robot: Robot
    config: NavigationConfig = field(default_factory=NavigationConfig)
    T_map_odom: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    legs: list[Leg] = field(default_factory=list)
    motion: Motion | None = None

    def follow(self, way_points: NDArray[np.float64], heading: float | None = None) -> bool:
        """Drive through (N, 2) way points and end looking along ``heading`` rad; True if all was reached."""
        for target in way_points:
            if not self._drive_leg(np.asarray(target)[:2]):
                return False
        return heading is None or self._finish(self._turn_to(lambda T: heading)) is Outcome.REACHED

    def _drive_leg(self, target: NDArray[np.float64]) -> bool:
        """Turn towards the way point, then drive straight to it."""
        T = self._drive(Velocity())
        started = self._time
        outcome = Outcome.REACHED
        if np.linalg.norm(target - T[:2, 3]) > self.config.position_tolerance:
            outcome = self._finish(self._approach(T, target))
        if outcome is not Outcome.REACHED:
            self._back_out()
        self.legs.append(Leg(target, outcome, self._time - started))
        return outcome is Outcome.REACHED

    def _approach(self, T: NDArray[np.float64], target: NDArray[np.float64]) -> Iterator[Velocity]:
        """Commands that bring the robot to the way point; on a ramp it does not turn, but backs where it must."""
        error = wrap_angle(_bearing(T[:2, 3], target) - yaw_of(T))
        backwards = self._on_ramp(T) and abs(error) > np.pi / 2
        if not self._on_ramp(T):
            yield from self._turn_to(lambda T: _bearing(T[:2, 3], target))
        yield from self._straight_to(T[:2, 3].copy(), target, backwards)

    def _on_ramp(self, T: NDArray[np.float64]) -> bool:
        return max(map(abs, tilt_of(T))) > self.config.ramp_tilt

    def _turn_to(self, heading: Callable[[NDArray[np.float64]], float]) -> Iterator[Velocity]:
        """Commands that turn on the spot, the shorter way, to the heading wanted at each pose."""
        config = self.config
        while True:
            T = self._T_map_base
            error = wrap_angle(heading(T) - yaw_of(T))
            if abs(error) < config.heading_tolerance:
                return
            rate = np.clip(config.turn_gain * abs(error), config.min_turn_rate, config.max_turn_rate)
            yield Velocity(0.0, float(np.sign(error) * rate))

    def _straight_to(
        self, start: NDArray[np.float64], target: NDArray[np.float64], backwards: bool
    ) -> Iterator[Velocity]:
        """Commands that follow the line from ``start`` until the robot is abreast of the target."""
        config = self.config
        length = float(np.linalg.norm(target - start))
        along = (target - start) / length
        left = np.array([-along[1], along[0]])
        bearing = np.arctan2(along[1], along[0]) + (np.pi if backwards else 0.0)
        while True:
            T = self._T_map_base
            remaining = float(length - (T[:2, 3] - start) @ along)
            if remaining < config.position_tolerance:
                return
            offset = float(np.clip(config.cross_track_gain * ((T[:2, 3] - start) @ left), -0.5, 0.5))
            error = wrap_angle(bearing - offset - yaw_of(T))
            # Slowing down before the way point keeps the wheels from skidding past it.
            speed = min(config.ramp_speed if self._on_ramp(T) else config.speed, max(0.05, remaining))
            rate = float(np.clip(config.turn_gain * error, -config.max_turn_rate, config.max_turn_rate))
            yield Velocity(-speed if backwards else speed, rate)

    def _finish(self, commands: Iterator[Velocity]) -> Outcome:
        """Give commands until they end, the robot leans too far, or nothing moves any more."""
        progress = _Progress(self.config)
        for command in commands:
            T = self._drive(command)
            if max(map(abs, tilt_of(T))) > self.config.max_tilt:
                return Outcome.TILTED
            if progress.is_stuck(T, self._time):
                return Outcome.STUCK
        self._drive(Velocity())
        return Outcome.REACHED

    def _back_out(self) -> None:
        """Back along the way the robot came, which is known to be free."""
        for _ in range(round(self.config.back_out / self.config.ramp_speed / self.robot.control_period)):
            self._drive(Velocity(-self.config.ramp_speed))
        self._drive(Velocity())

    def _drive(self, command: Velocity) -> NDArray[np.float64]:
        self.motion = self.robot.drive(command)
        return self._T_map_base

    @property
    def _T_map_base(self) -> NDArray[np.float64]:
        assert self.motion is not None
        return self.T_map_odom @ self.motion.T_odom_base

    @property
    def _time(self) -> float:
        assert self.motion is not None
        return self.motion.time


def _bearing(start: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    return float(np.arctan2(target[1] - start[1], target[0] - start[0]))
