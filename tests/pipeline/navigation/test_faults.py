"""What the robot notices of its camera."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.localisation.belief import Belief, MotionState
from pipeline.navigation.faults import Faults
from tests.pipeline.still_robot import StillRobot


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
