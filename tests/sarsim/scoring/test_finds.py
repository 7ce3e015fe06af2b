"""Finds that were reported, in a room of two signs and a tag."""

import mujoco
import numpy as np
import pytest

from pipeline.tracks.find import Find
from sarsim.scoring.finds import FindScore

ROOM = """<mujoco><size nuser_geom="1"/><custom>
<text name="a" data="kind=hazmat_sign;text=poison;state="/><text name="b" data="kind=hazmat_sign;text=oxygen;state="/>
<text name="c" data="kind=april_tag;text=7;state="/></custom><worldbody>
<body name="a" pos="2 0 0.5"><geom type="box" size="0.1 0.1 0.001" user="7"/></body>
<body name="b" pos="2 0.3 0.5"><geom type="box" size="0.1 0.1 0.001" user="7"/></body>
<body name="c" pos="0 3 0.5"><geom type="box" size="0.1 0.1 0.001" user="7"/></body></worldbody></mujoco>"""


@pytest.fixture
def score() -> FindScore:
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return FindScore(model, data, np.array([[-2.0, 0.0, 0.5]]))


def find(kind: str, text: str, x: float, y: float) -> Find:
    return Find(kind, text, np.array([x, y, 0.5]), np.eye(3), 0.0, 1.0, np.zeros((2, 2, 3), np.uint8))


def test_a_find_is_matched_with_the_thing_whose_text_it_has_even_if_another_is_nearer(score):
    signs = score.report([find("hazmat_sign", "poison", 2.0, 0.2), find("hazmat_sign", "oxygen", 2.0, 0.1)], False)
    figures = signs["hazmat_sign"]
    assert (figures["present"], figures["found"], figures["read"], figures["false_alarms"]) == (2, 2, 2, 0)
    assert figures["position_error_m"] == pytest.approx(0.2)


def test_what_is_far_from_any_thing_of_its_kind_is_a_false_alarm(score):
    reported = [
        find("hazmat_sign", "poison", 0.0, 3.0),
        find("april_tag", "8", 0.0, 3.0),
        find("april_tag", "7", -2, 0.1),
    ]
    figures = score.report(reported, False)
    assert figures["hazmat_sign"]["false_alarms"] == 1 and figures["hazmat_sign"]["found"] == 0
    tags = figures["april_tag"]
    assert (tags["found"], tags["read"], tags["false_alarms"]) == (1, 0, 0)  # the last is a fiducial's
    assert score.errors(reported)["april_tag"] == pytest.approx([0.0])


def test_heat_is_scored_with_a_thermal_camera_alone(score):
    assert "heat" not in score.report([], False)
    assert score.report([], True)["heat"]["present"] == 0
