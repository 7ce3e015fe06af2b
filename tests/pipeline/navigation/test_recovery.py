"""What a robot that was held puts into its map."""

import numpy as np

from pipeline.navigation.navigator import Halt
from pipeline.navigation.recovery import BUMPER_GAP, touched
from pipeline.robot import Velocity
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER


def test_what_it_touched_stands_right_before_the_end_that_went_ahead():
    for v, end in ((0.2, 1), (-0.2, -1)):
        points = touched(Halt(from_yaw(1, 2, 0, np.pi / 2), Velocity(v), True), PIONEER)
        np.testing.assert_allclose(points[:, 1], 2 + end * (PIONEER.half_length + BUMPER_GAP))
        np.testing.assert_allclose(np.ptp(points[:, 0]), PIONEER.width, rtol=1e-6)
        np.testing.assert_allclose(points[:, 2], PIONEER.body_height)
