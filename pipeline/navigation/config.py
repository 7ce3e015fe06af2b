"""Parameters of navigation."""

from dataclasses import dataclass
from math import radians

from pipeline.planning.stretches import ArcConfig


@dataclass(frozen=True)
class FollowerConfig:
    """How the robot follows stretches.

    Attributes:
        turn_gain: ratio of turn rate to heading error, 1/s (thesis 4.5).
        position_tolerance: distance within which the end of a stretch counts as reached, m.
        heading_tolerance: error within which a heading counts as reached, rad.
        lean: tilt above which the robot is on a ramp, even if only with its front wheels, rad.
        ramp_margin: distance from where the robot leaned within which it still drives as on a ramp, m: on the crest
            of a ridge, it is level.
        braking: share of its maximum acceleration, forwards and in turns, at which the robot brakes, so that the
            wheels do not skid past the end.
        shown: error of the heading that is acceptable when a viewpoint is passed, rad; the view is still the same.
        lead: time by which turn rates anticipate the curvature ahead, s, because the drive responds with a delay.
        least_pace: minimum share of its speed that the robot keeps, however far it is off its heading.
        still: speed below which the robot counts as standing and may turn in place, m/s.
        pivot_level: heading error up to which the robot corrects its heading while driving on level ground, rad.
        pivot_ramp: the same on a ramp, where the robot slides when it turns in place, rad.
        least_speed: a slower robot returns to its line as if at this speed, m/s, so that noise does not turn it.
        widest_return: maximum angle between the robot's heading and its line while it returns to the line, rad.
        hold_gain: speed per metre of present and expected slide in a turn on a ramp, 1/s; 0 for wheels that do not
            slide.
        carried_way: distance, m; a robot that moves farther than this in one control period, or starts farther than
            this from the start of its plan, was carried.
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
        tilt_lead: the robot backs out if it would lean too far within this time, s.
        most_way, least_way: bounds, m, within which the robot backs out as far as it came.
        most_turn, least_turn: bounds, rad, within which the robot turns back as far as it turned.
        enough: share of that distance or angle after which the robot counts as free.
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
        averaged: time over which speeds are averaged to detect that something holds the robot, s.
        held_share: share of the commanded speed below which the robot is held, unless it is on a ramp.
        patience: time without progress after which the robot is stuck, s.
        still_way, still_turn: displacement, m, and rotation, rad, up to which the robot makes no progress.
        overdue: maximum duration of a turn, s, and of a leg in excess of ``overdue_ramp`` times its duration at the
            speed on ramps. A robot that slides back and forth moves, but makes no progress.
        overdue_ramp: see ``overdue``.
        least_v, least_omega: speeds below which commands are not judged, m/s and rad/s.
        reaction: time during which a robot may still follow its previous command, s, because of delays on the network
            and at both ends. Longer intervals between two poses are not judged: a real robot gets no command while
            its software computes.
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
        every: distance driven between two checks, m.
        turn: angle by which an arc turns the camera between two checks, rad: about as often as keyframes are taken.
        ahead: distance from the robot's centre beyond which obstacles do not count yet, m.
        least_returns: minimum number of returns in a cell with an obstacle. In measurements, noise gave none, and the
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
        beside_people: distance from a person within which the robot drives no faster than ``people_speed``, m.
        people_speed: maximum speed near people, m/s.
        beside_ramps: distance from a ramp within which the robot drives as on the ramp, because its wheels may
            already be on it, m.
        arc_lag: time within which a robot that enters an arc must reach the arc's turn rate, s; until then, its path
            is too straight. A Pioneer reaches 0.8 rad/s; it then slides outwards, 4 to 6° off its heading (measured).
            At 1.5 rad/s, it slides by 12°.
    """

    beside_people: float = 1.0
    people_speed: float = 0.2
    beside_ramps: float = 0.2
    arc_lag: float = 0.46


@dataclass(frozen=True)
class AttitudeConfig:
    """How the robot estimates its tilt.

    Attributes:
        time_constant: time constant with which the estimated vertical follows the accelerometer, which bumps and
            braking disturb, s.
        most_disturbance: maximum difference from gravity at which an acceleration is used, m/s².
        most_change: maximum predicted change of the tilt, rad; bumps turn the robot quickly, but no farther.
    """

    time_constant: float = 0.5
    most_disturbance: float = 2.0
    most_change: float = radians(8)


@dataclass(frozen=True)
class FaultConfig:
    """Which faults of its own sensors the robot reports.

    Attributes:
        depth_scale: relative error of the floor's distance above which it is reported: three times the 1 % error of a
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
