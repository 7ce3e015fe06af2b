"""What the pipeline needs of a robot, be it simulated, recorded or real."""

from dataclasses import dataclass
from math import hypot
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.frame import Frame


@dataclass(frozen=True)
class Velocity:
    """A velocity command in ``base_link``: ``v`` m/s forward, ``omega`` rad/s counter-clockwise."""

    v: float = 0.0
    omega: float = 0.0


@dataclass(frozen=True, eq=False)
class Motion:
    """What the body's sensors measure after a control period.

    Attributes:
        time: s.
        T_odom_base: pose of ``base_link`` in ``odom``.
        gyro: (3,) rad/s in ``base_link``.
        accelerometer: (3,) m/s² in ``base_link``, gravity included (+9.81 along z at rest on level ground).
        wheel_speed: (2,) m/s of the left and right tyres, from the encoders.
    """

    time: float
    T_odom_base: Pose
    gyro: NDArray[np.float64]
    accelerometer: NDArray[np.float64]
    wheel_speed: NDArray[np.float64]

    @property
    def twist(self) -> Velocity:
        """Velocity of the body by its encoders and gyro."""
        return Velocity(float(self.wheel_speed.mean()), float(self.gyro[2]))


@dataclass(frozen=True)
class RobotModel:
    """The size and the abilities of a body: every clearance of the pipeline follows from these.

    The robot provides it, so that the pipeline contains no number of a particular body. The camera and its
    pose come with every :class:`pipeline.frame.Frame`. ``base_link`` lies in the middle of the footprint, on the
    ground.

    Attributes:
        length, width: of the footprint, wheels included, m.
        body_height: of the chassis without anything mounted on it, m.
        headroom: free height that the robot needs above the ground, its mast and a margin included, m.
        max_step: highest step that the robot is driven over, m.
        max_gap: widest gap that the robot rolls over, m.
        max_tilt: greatest tilt of ground that the robot is driven on, rad.
        tipping_tilt: tilt of the robot at which it stops and backs out, rad.
        speed, ramp_speed: driving speeds on level ground and on ramps, m/s.
        turn_rate, ramp_turn_rate: fastest turns on level ground and on ramps, rad/s.
        acceleration, turn_acceleration: of its drive, m/s² and rad/s².
        ramp_slide: greatest displacement in a quarter turn on the steepest ramp, m.
        slide_per_radian: slide downhill in a turn, per radian turned and times the sine of the tilt, m.
        min_turn_rate: slowest turn in place; in slower turns the tyres do not break loose, rad/s.
    """

    length: float
    width: float
    body_height: float
    headroom: float
    max_step: float
    max_gap: float
    max_tilt: float
    tipping_tilt: float
    speed: float
    ramp_speed: float
    turn_rate: float
    ramp_turn_rate: float
    acceleration: float
    turn_acceleration: float
    ramp_slide: float
    slide_per_radian: float
    min_turn_rate: float

    @property
    def half_length(self) -> float:
        """From the middle to the front of the footprint, m."""
        return self.length / 2

    @property
    def half_width(self) -> float:
        """From the middle to the side of the footprint, m."""
        return self.width / 2

    @property
    def corner_radius(self) -> float:
        """Radius of the circle that the corners sweep in a turn in place, m."""
        return hypot(self.half_length, self.half_width)


class Robot(Protocol):
    """A body with an RGB-D camera that can be driven."""

    model: RobotModel
    """Size and abilities of the body."""
    control_period: float
    """s that one call of ``drive`` lasts."""

    def sense(self) -> Frame:
        """Take a frame where the robot stands."""
        ...

    def drive(self, command: Velocity) -> Motion:
        """Follow ``command`` for one control period."""
        ...
