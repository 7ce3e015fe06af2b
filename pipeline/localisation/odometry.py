"""Localisation: where the robot is in ``map``."""

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame


class OdometryLocalisation:
    """Takes the odometry at its word: ``map`` and ``odom`` are one frame."""

    T_map_odom: NDArray[np.float64] = np.eye(4)

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` at the time of the frame."""
        return self.T_map_odom @ frame.T_odom_base
