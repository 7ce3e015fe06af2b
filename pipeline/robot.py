"""The interface between the pipeline and a robot, whether simulated, recorded or real."""

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
    """The measurements of the robot's sensors after a control period.

    Attributes:
        time: time of the measurements, s.
        T_odom_base: pose of ``base_link`` in ``odom``.
        gyro: (3,) rad/s, angular velocity in ``base_link``.
        accelerometer: (3,) m/s², acceleration in ``base_link``, gravity included (+9.81 along z at rest on level
            ground).
        wheel_speed: (2,) m/s, speeds of the left and right tyres, from the encoders.
    """

    time: float
    T_odom_base: Pose
    gyro: NDArray[np.float64]
    accelerometer: NDArray[np.float64]
    wheel_speed: NDArray[np.float64]

    @property
    def twist(self) -> Velocity:
        """The robot's velocity according to its encoders and gyro."""
        return Velocity(float(self.wheel_speed.mean()), float(self.gyro[2]))


@dataclass(frozen=True)
class RobotModel:
    """The size and abilities of a robot, from which all clearances in the pipeline are derived.

    The robot provides this model, so that the pipeline contains no number that belongs to a particular robot. The
    camera and its pose come with every :class:`pipeline.frame.Frame`. ``base_link`` lies at the centre of the
    footprint, on the ground.

    Attributes:
        length, width: size of the footprint, wheels included, m.
        body_height: height of the chassis without anything mounted on it, m.
        headroom: free height that the robot needs above the ground, its mast and a margin included, m.
        max_step: maximum height of a step that the robot may drive over, m.
        max_gap: maximum width of a gap that the robot can roll over, m.
        max_tilt: maximum tilt of the ground that the robot may drive on, rad.
        tipping_tilt: tilt of the robot at which it stops and backs out, rad.
        speed, ramp_speed: maximum speeds on level ground and on ramps, m/s.
        turn_rate, ramp_turn_rate: maximum turn rates on level ground and on ramps, rad/s.
        acceleration, turn_acceleration: maximum accelerations of the drive, m/s² and rad/s².
        ramp_slide: maximum displacement in a quarter turn on the steepest ramp, m.
        slide_per_radian: downhill slide per radian turned and per unit of the sine of the tilt, m/rad.
        min_turn_rate: minimum rate of a turn in place, rad/s; in slower turns, the tyres stick.
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
        """Distance from the centre to the front of the footprint, m."""
        return self.length / 2

    @property
    def half_width(self) -> float:
        """Distance from the centre to the side of the footprint, m."""
        return self.width / 2

    @property
    def corner_radius(self) -> float:
        """Radius of the circle that the corners describe in a turn in place, m."""
        return hypot(self.half_length, self.half_width)


class Robot(Protocol):
    """A robot with an RGB-D camera."""

    model: RobotModel
    """Size and abilities of the robot."""
    control_period: float
    """Duration of one call of ``drive``, s."""

    def sense(self) -> Frame:
        """Take a frame at the robot's current position."""
        ...

    def drive(self, command: Velocity) -> Motion:
        """Follow ``command`` for one control period."""
        ...
