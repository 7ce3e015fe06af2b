"""The cloud of a frame for registration."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import required
from pipeline.localisation.config import RegistrationConfig
from pipeline.localisation.frame_cloud import cloud_of_frame
from pipeline.transforms import from_yaw
from tests.pipeline.localisation.driving_robot import seen


@pytest.mark.parametrize("empty", [np.inf, np.nan])
def test_a_depth_that_is_not_finite_counts_as_no_return(empty: float) -> None:
    frame = seen(from_yaw(1.2, 1.0, 0, 0.3), np.eye(4))
    hole = np.zeros(frame.depth.shape, np.bool_)
    hole[100:140, 100:140] = True
    clouds = [
        required(cloud_of_frame(replace(frame, depth=np.where(hole, value, frame.depth)), RegistrationConfig()))
        for value in (0, empty)
    ]
    np.testing.assert_array_equal(clouds[1].points(), clouds[0].points())
