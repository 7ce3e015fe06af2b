"""Victims that were found, in a room of two."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pipeline.frame import Intrinsics
from sarsim.scoring.victims import VictimScore
from sarsim.scoring.visibility import MIN_VISIBLE_PIXELS
from sarsim.sensors.camera import LabelledImage

ROOM = """<mujoco><size nuser_geom="1"/><worldbody><geom type="plane" size="5 5 1" user="2"/>
<body name="victim_a" pos="1 0 0.2"><geom type="box" size="0.5 0.2 0.2" user="6"/>
<geom type="box" pos="0.7 0 0" size="0.2 0.1 0.1" user="6"/></body>
<body name="victim_b" pos="0 2 0.2"><geom type="sphere" size="0.2" user="6"/></body></worldbody></mujoco>"""
A, B = (1.2, 0.0, 0.2), (0.0, 2.0, 0.2)
IMAGE = LabelledImage(
    rgb=np.zeros((40, 40, 3), np.uint8),
    depth=np.ones((40, 40), np.float32),
    label=np.zeros((40, 40), np.uint8),
    instance=np.zeros((40, 40), np.int32),
    intrinsics=Intrinsics(40, 40, 40.0, 40.0, 20.0, 20.0),
    T_world_camera=np.eye(4),
    T_base_camera=np.eye(4),
)


@pytest.fixture
def score():
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return VictimScore(model, data)


def shown(pixels: int, geom: int) -> LabelledImage:
    instance = np.zeros((40, 40), np.int32)
    instance.ravel()[:pixels] = geom
    return replace(IMAGE, instance=instance)


def test_the_true_position_is_the_middle_of_the_whole_person(score):
    np.testing.assert_allclose(score.positions, [A, B], atol=1e-9)


def test_a_person_near_enough_is_found_and_all_else_is_a_false_alarm(score):
    report = score.report(np.array([(1.2, 0.3, 0.2), (0.0, 2.0, 0.8), (3.0, 3.0, 0.0)]))
    assert report == {
        "present": 2,
        "found": 1,
        "false_alarms": 2,
        "position_error_m": pytest.approx(0.3),
        "visible": 0,
        "visible_found": 0,
    }


def test_a_person_reported_twice_is_found_once(score):
    report = score.report(np.array([(1.2, 0.3, 0.2), (1.2, -0.1, 0.2)]))
    assert (report["found"], report["false_alarms"]) == (1, 1)
    assert report["position_error_m"] == pytest.approx(0.1)


def test_as_many_as_possible_are_found():
    score = VictimScore.__new__(VictimScore)
    score.positions = np.array([(0.0, 0.0, 0.0), (0.4, 0.0, 0.0)])
    # The first is nearer to both; the second can only be the one at 0.1 m.
    np.testing.assert_allclose(score.matches(np.array([(0.1, 0.0, 0.0), (-0.3, 0.0, 0.0)])), [0.3, 0.3])


def test_no_one_found_has_no_error(score):
    report = score.report(np.zeros((0, 3)))
    assert report["position_error_m"] is None
    assert (report["found"], report["false_alarms"]) == (0, 0)


def test_a_person_in_view_counts_as_visible(score):
    score.add(shown(MIN_VISIBLE_PIXELS - 1, 3))
    assert not score.visible.any()
    score.add(shown(MIN_VISIBLE_PIXELS, 3))
    assert score.visible.tolist() == [False, True]
    assert score.report(np.array([B]))["visible_found"] == 1
