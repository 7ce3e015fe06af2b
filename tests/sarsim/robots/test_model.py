"""The model of a robot whose speed a flag limits."""

import pytest

from sarsim.robots.model import drive_model, paced_model, robot_model


@pytest.mark.parametrize(("speed", "driven", "on_ramps"), [(0.1, 0.1, 0.1), (0.5, 0.5, 0.3), (99.0, 0.7, 0.3)])
def test_no_speed_of_the_robot_exceeds_the_one_given(speed, driven, on_ramps):
    assert (robot_model("pioneer3at").ramp_speed, drive_model("pioneer3at").top_speed) == (0.3, 0.7)
    model = paced_model("pioneer3at", speed)
    assert (model.speed, model.ramp_speed) == (driven, on_ramps)


def test_without_one_the_robot_keeps_its_own_speeds():
    assert paced_model("jackal", None) == robot_model("jackal")
