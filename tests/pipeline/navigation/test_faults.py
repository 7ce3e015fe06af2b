"""What the robot notices of its camera."""

from dataclasses import replace

import pytest

from pipeline.explorer import Explorer
from pipeline.localisation.localisation import LostError
from pipeline.mapper import Mapper
from pipeline.navigation.faults import Faults
from pipeline.navigation.pose_check import LOOKS
from pipeline.semantic_map.classifier import TruthClassifier
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot


def test_a_camera_without_depth_ends_the_drive(monkeypatch) -> None:
    keyframing = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier())).keyframing
    frame = StillRobot().sense()
    for _ in range(2):  # what it sees between blank frames resets the count
        monkeypatch.setattr(StillRobot, "sense", lambda robot: replace(frame, depth=0 * frame.depth))
        for _ in range(LOOKS - 1):
            keyframing.sense()
        monkeypatch.setattr(StillRobot, "sense", lambda robot: frame)
        keyframing.sense()
    monkeypatch.setattr(StillRobot, "sense", lambda robot: replace(frame, depth=0 * frame.depth))
    with pytest.raises(LostError, match=f"no depth in {LOOKS} frames"):
        for _ in range(LOOKS):
            keyframing.sense()


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
