"""What the robot learns about obstacles from being held."""

import numpy as np
from numpy.typing import NDArray

from pipeline.navigation.navigator import Halt
from pipeline.robot import RobotModel
from pipeline.transforms import transform_points

BUMPER_GAP = 0.036
"""m before the footprint at which the robot maps what it touched."""


def touched(halt: Halt, robot: RobotModel) -> NDArray[np.float64]:
    """(N, 3) points in ``map`` right before the leading end of the robot that was held, as high as its body, m."""
    ahead = (robot.half_length + BUMPER_GAP) * np.sign(halt.command.v)
    across = np.linspace(-robot.half_width, robot.half_width, 21)
    points = [[ahead, left, robot.body_height] for left in across]
    return transform_points(halt.T_map_base, np.array(points)).astype(np.float64)
