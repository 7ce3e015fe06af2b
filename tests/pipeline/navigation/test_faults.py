"""What the robot notices of its camera."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.explorer import Explorer
from pipeline.localisation.belief import Belief, MotionState
from pipeline.localisation.localisation import LostError
from pipeline.mapper import Mapper
from pipeline.navigation.faults import Faults
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot


@pytest.mark.parametrize(
    ("move", "most"), [(from_yaw(0, 0, 0, 1), 7), (from_yaw(0.3, 0, 0, 0), 3), (from_yaw(0.001, 0, 0, 0), 50)]
)
def test_a_camera_without_depth_is_noticed_where_it_ought_to_see(move, most: int, monkeypatch) -> None:
    keyframing = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier())).keyframing
    monkeypatch.setattr(keyframing.pose_check, "expects", lambda frame: True)
    frame, T = StillRobot().sense(), np.eye(4)

    def sense(share: float) -> None:
        nonlocal T
        T = T @ move
        seen = replace(frame, depth=np.float32(share) * frame.depth, T_odom_base=T)
        monkeypatch.setattr(StillRobot, "sense", lambda robot: seen)
        keyframing.returns()

    for _ in range(2):  # what it sees in between counts
        for _ in range(most):
            sense(0)
        sense(1)
    if most < 50:
        with pytest.raises(LostError, match=f"no depth: at 0.00 s in {most + 1} frames"):
            for _ in range(most + 1):
                sense(0)


@pytest.mark.parametrize(("scale", "is_noted"), [(1.0, False), (1.02, False), (1.05, True), (0.95, True)])
def test_a_wrong_scale_of_depth_shows_on_the_floor(scale: float, is_noted: bool) -> None:
    faults, frame = Faults(), StillRobot().sense()
    faults.check_depth_scale(replace(frame, depth=scale * frame.depth))
    assert [fault.kind for fault in faults.all] == is_noted * ["depth_scale"]


def test_a_fault_that_lasts_is_noted_once() -> None:
    faults = Faults()
    for kind, time in (("a", 1.0), ("a", 2.0), ("b", 3.0), ("a", 4.0)):
        faults.note(kind, time, kind)
    assert [fault.time_s for fault in faults.all] == [1.0, 3.0, 4.0]


def test_what_keeps_the_robot_from_moving_as_its_odometry_says_is_noted() -> None:
    faults, belief = Faults(), Belief()
    for state in MotionState:
        belief.probabilities = np.eye(len(MotionState))[state]
        faults.check_motion(belief, 1.0)
    assert [fault.kind for fault in faults.all] == ["slipping", "held", "blind"]
