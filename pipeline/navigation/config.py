"""The numbers of navigation."""

from dataclasses import dataclass
from math import radians

from pipeline.planning.stretches import ArcConfig


@dataclass(frozen=True)
class FollowerConfig:
    """How the robot follows way points.

    Attributes:
        turn_gain: 1/s, turn rate over heading error (thesis 4.5).
        position_tolerance: m; a way point counts as reached this close to it.
        heading_tolerance: rad; a heading counts as reached this close to it.
        lean: rad; a robot that leans more is on a ramp, even if only with its front wheels.
        ramp_margin: m from where it leaned within which it still drives as on a ramp: on the crest of a ridge it
            stands level.
        braking: share of its acceleration, forwards and in turns, by which it brakes, so that the wheels do not skid
            past the end.
        shown: rad by which the heading may be off when a viewpoint is passed; the view still shows the same.
        lead: s by which turn rates anticipate the curvature ahead, because the drive responds with a delay.
        least_pace: least share of its speed that the robot keeps, however far it is off its heading.
        still: m/s; a slower robot counts as standing and may turn in place.
        pivot_level: rad; on level ground, smaller errors of the heading are corrected while driving.
        pivot_ramp: rad; the same on a ramp, where the robot slides when it turns in place.
        least_speed: m/s; a slower robot returns to its line as if at this speed, so that noise does not turn it.
        widest_return: rad, greatest angle between the robot's heading and its line while it returns to the line.
        hold_gain: 1/s, speed per metre of present and expected slide in a turn on a ramp; 0 for wheels that do not
            slide.
        carried_way: m; a robot that moves farther than this in one control period, or starts farther than this from
            the start of its plan, was carried.
    """

    turn_gain: float = 1.5
    position_tolerance: float = 0.04
    heading_tolerance: float = radians(2)
    lean: float = radians(6)
    ramp_margin: float = 0.2
    braking: float = 0.8
    shown: float = radians(10)
    lead: float = 0.2
    least_pace: float = 0.2
    still: float = 0.02
    pivot_level: float = radians(15)
    pivot_ramp: float = radians(35)
    least_speed: float = 0.2
    widest_return: float = 0.5
    hold_gain: float = 1.0
    carried_way: float = 0.3


@dataclass(frozen=True)
class RecoveryConfig:
    """How the robot gets out of a halt.

    Attributes:
        tilt_lead: s; the robot backs out if it would lean too far within this time.
        most_way, least_way: m; it backs out as far as it came, within these bounds.
        most_turn, least_turn: rad; it turns back as far as it turned, within these bounds.
        enough: share of that distance or angle after which it counts as free.
    """

    tilt_lead: float = 0.1
    most_way: float = 0.3
    least_way: float = 0.02
    most_turn: float = radians(15)
    least_turn: float = radians(2)
    enough: float = 0.5


@dataclass(frozen=True)
class ProgressConfig:
    """When a robot counts as held or stuck.

    Attributes:
        averaged: s over which speeds are averaged to detect that something holds the robot.
        held_share: share of the commanded speed; a slower robot is held, unless it is on a ramp.
        patience: s without progress after which the robot is stuck.
        still_way, still_turn: m and rad; a robot that moves less makes no progress.
        overdue: s that a turn may take, and that a leg may take in addition to ``overdue_ramp`` times its duration at
            the speed on ramps. A robot that slides back and forth moves, but makes no progress.
        overdue_ramp: see ``overdue``.
        least_v, least_omega: m/s and rad/s; slower commands are not judged.
        reaction: s during which a robot may still follow its last command, because of delays on the network and at
            both ends. Longer intervals between two poses are not judged: a real robot gets no command while its
            software computes.
    """

    averaged: float = 0.5
    held_share: float = 0.35
    patience: float = 4.0
    still_way: float = 0.02
    still_turn: float = radians(2)
    overdue: float = 60.0
    overdue_ramp: float = 4.0
    least_v: float = 0.04
    least_omega: float = 0.15
    reaction: float = 0.3


@dataclass(frozen=True)
class ObstacleCheckConfig:
    """When an obstacle that the map does not show counts.

    Attributes:
        every: m of straight driving between two checks.
        turn: rad by which an arc turns the camera between two checks: about as often as keyframes are taken.
        ahead: m from the robot's middle; obstacles farther away do not count yet.
        least_returns: least number of returns in a cell with an obstacle. In measurements noise gave none, and the
            thickest dust at most 17.
    """

    every: float = 0.4
    turn: float = radians(15)
    ahead: float = 2.0
    least_returns: int = 50


@dataclass(frozen=True)
class SpeedLimitConfig:
    """Where the robot slows down.

    Attributes:
        beside_people: m from a person within which it drives no faster than ``people_speed``.
        people_speed: m/s.
        beside_ramps: m from a ramp within which it drives as on the ramp, because its wheels may already be on it.
        arc_lag: s within which a robot that enters an arc must reach the arc's turn rate; until then it drives too
            straight. A Pioneer reaches 0.8 rad/s, at which it slides outwards by 4 to 6° of its heading, measured; at
            1.5 rad/s it slides by 12°.
    """

    beside_people: float = 1.0
    people_speed: float = 0.2
    beside_ramps: float = 0.2
    arc_lag: float = 0.46


@dataclass(frozen=True)
class AttitudeConfig:
    """How the robot estimates its tilt.

    Attributes:
        time_constant: s, time constant with which the estimated vertical follows the accelerometer, which bumps and
            braking disturb.
        most_disturbance: m/s²; accelerations that differ more than this from gravity are ignored.
        most_change: rad; bumps turn the robot quickly, but no farther than this.
    """

    time_constant: float = 0.5
    most_disturbance: float = 2.0
    most_change: float = radians(8)


@dataclass(frozen=True)
class FaultConfig:
    """Which faults of its own sensors the robot reports.

    Attributes:
        depth_scale: relative error of the floor's depth from which on it is reported: three times the 1 % error of a
            calibrated camera of this kind (Khoshelham & Oude Elberink, 2012).
    """

    depth_scale: float = 0.03


@dataclass(frozen=True)
class NavigationConfig:
    """All settings of navigation."""

    follower: FollowerConfig = FollowerConfig()
    recovery: RecoveryConfig = RecoveryConfig()
    progress: ProgressConfig = ProgressConfig()
    obstacle_check: ObstacleCheckConfig = ObstacleCheckConfig()
    speed_limit: SpeedLimitConfig = SpeedLimitConfig()
    arcs: ArcConfig = ArcConfig()
    attitude: AttitudeConfig = AttitudeConfig()
    faults: FaultConfig = FaultConfig()
