"""What the pipeline asks of a body: a simulated one, a recording, one day a real one."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame


@dataclass(frozen=True)
class Velocity:
    """A velocity command in ``base_link``: ``v`` m/s forward, ``omega`` rad/s counter-clockwise."""

    v: float = 0.0
    omega: float = 0.0


@dataclass(frozen=True, eq=False)
class Motion:
    """What the body feels after a control period.

    Attributes:
        time: s.
        T_odom_base: 4×4 pose of ``base_link`` in ``odom``.
        gyro: (3,) rad/s in ``base_link``.
        accelerometer: (3,) m/s² in ``base_link``, gravity included (+9.81 along z at rest on level ground).
        wheel_speed: (2,) m/s of the left and right tyres, from the encoders.
    """

    time: float
    T_odom_base: NDArray[np.float64]
    gyro: NDArray[np.float64]
    accelerometer: NDArray[np.float64]
    wheel_speed: NDArray[np.float64]


class Robot(Protocol):
    """A body with an RGB-D camera that can be driven."""

    control_period: float
    """Seconds that one call of ``drive`` lasts."""

    def sense(self) -> Frame:
        """Take one look, standing."""
        ...

    def drive(self, command: Velocity) -> Motion:
        """Follow ``command`` for one control period."""
        ...
