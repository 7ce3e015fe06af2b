"""Parameters of navigation."""

from dataclasses import dataclass
from math import radians

from pipeline.errors import require_at_least, require_positive
from pipeline.planning.stretches import ArcConfig


@dataclass(frozen=True)
class FollowerConfig:
    """How the robot follows stretches.

    Attributes:
        turn_gain: ratio of turn rate to heading error, 1/s (thesis 4.5).
        position_tolerance: distance within which the end of a stretch is considered reached, m.
        heading_tolerance: error within which a heading is considered reached, rad.
        lean: tilt above which the robot is considered to be on a ramp, even if only with its front wheels, rad.
        braking: fraction of its maximum acceleration, forwards and in turns, at which the robot brakes, so that the
            wheels do not skid past the end.
        pivot_level: heading error up to which the robot corrects its heading while driving on level ground, rad.
        pivot_ramp: heading error up to which the robot corrects its heading while driving on a ramp, where it slides
            when it turns in place, rad.
        max_offset: distance from the line of a stretch beyond which the robot does not begin the stretch after the
            turn to its heading, m. The default is the deviation that plans allow for on a straight drive.
        hold_gain: speed per metre of present and expected slide in a turn on a ramp, 1/s; 0 for wheels that do not
            slide.
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
        max_distance: maximum distance by which the robot backs out, m; it backs out no farther than it came.
        max_turn: maximum angle by which the robot turns back, rad; it turns back no farther than it turned.
        drives_back: number of times that a robot, lost after a halt, drives back by ``max_distance`` to look around.
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
        held_share: fraction of the commanded speed below which the robot is held.
        patience: time without progress after which the robot is considered stuck, and time after which it is
            considered held on a ramp, s.
        overdue: maximum duration of a turn, and maximum delay of a leg compared with a drive at low speed, s. A robot
            that slides back and forth moves, but makes no progress.
    """

    held_share: float = 0.35
    patience: float = 4.0
    overdue: float = 60.0

    def __post_init__(self) -> None:
        """Raise InputError if the robot would be considered stuck at once."""
        require_positive("navigation.progress", self, "patience", "overdue")
        require_at_least(0, "navigation.progress", self, "held_share")


@dataclass(frozen=True)
class ObstacleCheckConfig:
    """How the robot checks its path for obstacles that the map does not show.

    Attributes:
        distance_between_checks: distance driven between two checks, m.
        turn: angle by which an arc turns the camera between two checks, rad; keyframes are taken about as often.
        ahead: distance from the robot's centre beyond which obstacles are ignored, m.
        min_returns: minimum number of returns in a cell with an obstacle. In measurements, noise gave none, and the
            thickest dust at most 17.
    """

    distance_between_checks: float = 0.4
    turn: float = radians(15)
    ahead: float = 2.0
    min_returns: int = 50


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
class FaultConfig:
    """Limits beyond which the robot reports faults of its own sensors.

    Attributes:
        depth_scale: relative error of the distance to the floor above which it is reported; the default is three
            times the 1% error of a calibrated camera of this kind (Khoshelham & Oude Elberink, 2012).
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
    faults: FaultConfig = FaultConfig()
