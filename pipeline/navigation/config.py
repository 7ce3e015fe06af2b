"""Settings of navigation."""

from dataclasses import dataclass
from math import radians

from pipeline.errors import require_at_least, require_positive
from pipeline.planning.stretches import ArcConfig


@dataclass(frozen=True)
class FollowerConfig:
    """How the robot follows stretches.

    Attributes:
        turn_gain: ratio of turn rate to heading error, 1/s (thesis 4.5).
        position_tolerance: remaining distance below which the end of a stretch is considered reached, m.
        heading_tolerance: heading error below which a heading is considered reached, rad.
        lean: tilt above which the robot is considered to be on a ramp, at least with its front wheels, rad.
        braking: deceleration of the robot, in drives and in turns, as a fraction of its maximum acceleration; below
            1, the wheels do not skid past the end.
        pivot_level: maximum heading error that the robot corrects while driving on level ground, rad; to correct a
            larger error, it turns in place.
        pivot_ramp: maximum heading error that the robot corrects while driving on a ramp, where it would slide in a
            turn in place, rad.
        max_offset: maximum distance from the line of a stretch, after the turn to its heading, at which the robot
            begins the stretch, m. The default is the deviation that plans allow for on a straight drive.
        hold_gain: ratio of the speed that compensates for sliding in a turn on a ramp to the present and expected
            slide, 1/s; 0 for wheels that do not slide.
    """

    turn_gain: float = 1.5
    position_tolerance: float = 0.04
    heading_tolerance: float = radians(2)
    lean: float = radians(6)
    braking: float = 0.8
    pivot_level: float = radians(15)
    pivot_ramp: float = radians(35)
    max_offset: float = 0.1
    hold_gain: float = 1.0

    def __post_init__(self) -> None:
        """Raise InputError if the robot could not follow a path with these settings."""
        section = "navigation.follower"
        require_positive(section, self, "turn_gain", "position_tolerance", "heading_tolerance", "braking")
        require_at_least(0, section, self, "lean", "pivot_level", "pivot_ramp", "max_offset", "hold_gain")


@dataclass(frozen=True)
class RecoveryConfig:
    """How the robot recovers from a halt.

    Attributes:
        max_distance: maximum distance by which the robot backs out, m, unless it leans; it never backs out much
            farther than it drove.
        max_turn: maximum angle by which the robot turns back, rad; it never turns back much farther than it turned.
        drives_back: maximum number of times that the robot drives back by ``max_distance`` and looks around again if,
            after a halt, it is lost or still held.
    """

    max_distance: float = 0.3
    max_turn: float = radians(15)
    drives_back: int = 2

    def __post_init__(self) -> None:
        """Raise InputError if the robot could not back out with these settings."""
        require_positive("navigation.recovery", self, "max_distance", "max_turn")
        require_at_least(0, "navigation.recovery", self, "drives_back")


@dataclass(frozen=True)
class ProgressConfig:
    """When a robot is considered held or stuck.

    Attributes:
        held_fraction: fraction of the expected speed or turn rate below which the robot is considered held. The
            expected values follow the commands with the robot's accelerations.
        patience: time without progress after which the robot is considered stuck, s. On a ramp, the robot must be
            held for the same time to be considered stuck.
        max_delay: maximum duration of a turn, and maximum delay of a leg relative to a drive at a quarter of the ramp
            speed, s. This limit stops a robot that slides back and forth.
    """

    held_fraction: float = 0.35
    patience: float = 4.0
    max_delay: float = 60.0

    def __post_init__(self) -> None:
        """Raise InputError if the robot would be considered stuck at once."""
        require_positive("navigation.progress", self, "patience", "max_delay")
        require_at_least(0, "navigation.progress", self, "held_fraction")


@dataclass(frozen=True)
class ObstacleCheckConfig:
    """How the robot checks its path for obstacles that the map does not show.

    Attributes:
        distance_between_checks: distance driven between two checks, m.
        angle_between_checks: angle by which the camera turns along an arc between two checks, rad.
        ahead: distance along the path from the robot's centre beyond which obstacles are ignored, m.
        min_returns: minimum number of the camera's returns in a cell that contains an obstacle. In measurements,
            noise caused no returns in a cell, and the thickest dust at most 17.
    """

    distance_between_checks: float = 0.4
    angle_between_checks: float = radians(15)
    ahead: float = 2.0
    min_returns: int = 50

    def __post_init__(self) -> None:
        """Raise InputError if the robot could not check its path with these settings."""
        section = "navigation.obstacle_check"
        require_positive(section, self, "ahead")
        require_at_least(0, section, self, "distance_between_checks", "angle_between_checks")
        require_at_least(1, section, self, "min_returns")


@dataclass(frozen=True)
class SpeedLimitConfig:
    """Where the robot slows down.

    Attributes:
        beside_people: distance from a person within which the robot drives no faster than ``speed_near_people``, m.
        speed_near_people: maximum speed near people, m/s.
        beside_ramps: distance from a ramp within which the robot drives as on the ramp, because its wheels may
            already be on the ramp, m.
        arc_lag: time in which a robot that enters an arc must be able to reach the arc's turn rate, s; until then,
            its path is too straight. A Pioneer reaches 0.8 rad/s, at which it slides outwards, 4 to 6° off its
            heading (measured); at 1.5 rad/s, it would slide 12° off.
        max_bend_offset: maximum distance to which a bend without an arc may carry the robot off its line, m.
    """

    beside_people: float = 1.0
    speed_near_people: float = 0.2
    beside_ramps: float = 0.2
    arc_lag: float = 0.46
    max_bend_offset: float = 0.02

    def __post_init__(self) -> None:
        """Raise InputError if the robot could not drive near people or in arcs with these settings."""
        require_positive("navigation.speed_limit", self, "speed_near_people", "arc_lag", "max_bend_offset")
        require_at_least(0, "navigation.speed_limit", self, "beside_people", "beside_ramps")


@dataclass(frozen=True)
class FaultConfig:
    """Limit beyond which the robot reports a fault in its depth camera.

    Attributes:
        max_depth_scale_error: relative error of the measured height of the camera above which a fault is reported;
            the default is three times the 1% error of a calibrated depth camera (Khoshelham & Oude Elberink, 2012).
    """

    max_depth_scale_error: float = 0.03


@dataclass(frozen=True)
class NavigationConfig:
    """All settings of navigation."""

    follower: FollowerConfig = FollowerConfig()
    recovery: RecoveryConfig = RecoveryConfig()
    progress: ProgressConfig = ProgressConfig()
    obstacle_check: ObstacleCheckConfig = ObstacleCheckConfig()
    speed_limit: SpeedLimitConfig = SpeedLimitConfig()
    arcs: ArcConfig = ArcConfig()
    faults: FaultConfig = FaultConfig()
