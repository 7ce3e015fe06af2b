"""Where a robot is, and where it believes to be."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Pose:
    """A moment of a trajectory.

    Attributes:
        time: s.
        T_world_base: 4×4 true pose.
        T_odom_base: 4×4 what the odometry believes.
    """

    time: float
    T_world_base: NDArray[np.float64]
    T_odom_base: NDArray[np.float64]
