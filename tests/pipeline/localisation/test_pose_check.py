"""What a pose check says of a camera that shows nothing."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.localisation import LocalisedFrame, LostError
from pipeline.localisation.pose_check import PoseCheck
from pipeline.mapper import Mapper, sense_and_map
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot


@pytest.fixture(scope="module")
def mapper() -> Mapper:
    mapper = Mapper(PIONEER, TruthClassifier())
    sense_and_map(mapper, StillRobot().sense, labelled=False)
    return mapper


@pytest.mark.parametrize(
    ("move", "most"), [(from_yaw(0, 0, 0, 1), 7), (from_yaw(0.3, 0, 0, 0), 3), (from_yaw(0.001, 0, 0, 0), 50)]
)
def test_a_camera_without_depth_is_noticed_where_it_ought_to_see(mapper: Mapper, move: np.ndarray, most: int) -> None:
    maps = mapper.localisation, mapper.metric_map, mapper.elevation_map, mapper.keyframes
    check, frame, T = PoseCheck(*maps, PIONEER, LocalisationConfig()), StillRobot().sense(), np.eye(4)

    def see(share: float) -> None:
        nonlocal T
        T = T @ move
        seen = replace(frame, depth=np.float32(share) * frame.depth, T_odom_base=T)
        check.check_depth(LocalisedFrame(seen, np.eye(4)))

    for _ in range(2):  # what it sees in between counts
        for _ in range(most):
            see(0)
        see(1)
    if most < 50:
        with pytest.raises(LostError, match="depth"):
            for _ in range(most + 1):
                see(0)


def test_blank_frames_far_apart_are_not_in_a_row(mapper: Mapper) -> None:
    """Between them, the camera looks where nothing is mapped."""
    maps = mapper.localisation, mapper.metric_map, mapper.elevation_map, mapper.keyframes
    check, frame = PoseCheck(*maps, PIONEER, LocalisationConfig()), StillRobot().sense()
    check.check_depth(LocalisedFrame(frame, np.eye(4)))
    for step in range(9):
        blank = replace(frame, depth=np.zeros_like(frame.depth), T_odom_base=from_yaw(0.3 * step, 0, 0, 0))
        check.check_depth(LocalisedFrame(blank, from_yaw(0, 0, 0, np.pi if step % 4 else 0.0)))
