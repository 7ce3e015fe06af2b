"""Finds that were reported, in a room of two signs and a tag."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from pipeline.tracks.find import Find
from sarsim.plugins.finds.score import FindScore

ROOM = """<mujoco><size nuser_geom="1"/><custom>
<text name="a" data="kind=hazmat_sign;text=poison;state="/><text name="b" data="kind=hazmat_sign;text=oxygen;state="/>
<text name="c" data="kind=april_tag;text=7;state="/></custom><worldbody>
<body name="a" pos="2 0 0.5"><geom type="box" size="0.1 0.1 0.001" user="7"/></body>
<body name="b" pos="2 0.3 0.5"><geom type="box" size="0.1 0.1 0.001" user="7"/></body>
<body name="c" pos="0 3 0.5"><geom type="box" size="0.1 0.1 0.001" user="7"/></body>
<body name="fiducial_0" pos="-2 0 0.5"/></worldbody></mujoco>"""

FOUND = SimpleNamespace(reported=[])
"""What the robot reports."""


@pytest.fixture
def score() -> FindScore:
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    physics = SimpleNamespace(model=SimpleNamespace(ptr=model), data=SimpleNamespace(ptr=data))
    robot = SimpleNamespace(physics=physics, true_frame=SimpleNamespace(image=nothing_seen(model)))
    return FindScore(robot, SimpleNamespace(finds=FOUND))


def nothing_seen(model: mujoco.MjModel):
    """An image that shows no geom."""
    shape = (4, 4)
    nowhere = np.full(shape, -1, np.int32)
    return SimpleNamespace(instance=nowhere, depth=np.zeros(shape, np.float32), geom=nowhere)


def scored(score: FindScore, reported: list[Find]) -> dict:
    FOUND.reported = reported
    return score.figures()["finds"]


def find(kind: str, text: str, x: float, y: float) -> Find:
    return Find(kind, text, np.array([x, y, 0.5]), np.eye(3), 0.0, 1.0, np.zeros((2, 2, 3), np.uint8))


def test_a_find_is_matched_with_the_thing_whose_text_it_has_even_if_another_is_nearer(score):
    signs = scored(score, [find("hazmat_sign", "poison", 2.0, 0.2), find("hazmat_sign", "oxygen", 2.0, 0.1)])
    figures = signs["hazmat_sign"]
    assert (figures["present"], figures["found"], figures["read"], figures["false_alarms"]) == (2, 2, 2, 0)
    assert figures["position_error_m"] == pytest.approx(0.2)


def test_what_is_far_from_any_thing_of_its_kind_is_a_false_alarm(score):
    reported = [
        find("hazmat_sign", "poison", 0.0, 3.0),
        find("april_tag", "8", 0.0, 3.0),
        find("april_tag", "7", -2, 0.1),
    ]
    figures = scored(score, reported)
    assert figures["hazmat_sign"]["false_alarms"] == 1 and figures["hazmat_sign"]["found"] == 0
    tags = figures["april_tag"]
    assert (tags["found"], tags["read"], tags["false_alarms"]) == (1, 0, 0)  # the last is a fiducial's
    assert score.errors["april_tag"] == pytest.approx([0.0])


def test_heat_is_scored_with_a_thermal_camera_alone(score):
    assert "heat" not in scored(score, [])
    score.on_keyframe(SimpleNamespace(frame=SimpleNamespace(thermal=np.zeros((2, 2)))))
    assert scored(score, [])["heat"]["present"] == 0
