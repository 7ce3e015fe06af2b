"""True and estimated poses of a robot."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class TrajectorySample:
    """One sample of a trajectory.

    Attributes:
        time: time of the sample, s.
        T_world_base: 4×4 true pose of ``base_link`` in the world; NaN where a recording lacks it.
        T_odom_base: 4×4 pose of ``base_link`` in ``odom``, by dead reckoning.
    """

    time: float
    T_world_base: NDArray[np.float64]
    T_odom_base: NDArray[np.float64]
