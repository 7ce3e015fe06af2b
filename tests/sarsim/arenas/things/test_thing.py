"""What the things of a model are, from the texts of its MJCF."""

from xml.etree.ElementTree import Element, tostring

import mujoco
import numpy as np
from dm_control import mjcf
from numpy.testing import assert_allclose

from pipeline.tracks.find import KINDS
from sarsim.arenas.things.thing import annotate_body, data_of, things_of, things_of_kind

ARENA = """<mujoco><size nuser_geom="1"/><worldbody>
<body name="victim_a" pos="1 0 0"><geom size="0.1" user="6"/></body>
<body name="victim_b"><geom size="0.1" user="6"/><geom name="box" size="1" user="7"/></body>
<body name="sign" pos="0 1 2" euler="0 90 0">
<geom name="plate" type="box" size="0.1 0.2 0.3" pos="0 0 -0.3" user="7"/></body>
<body name="shelf"><geom size="0.1" user="7"/></body></worldbody><custom>{}</custom></mujoco>"""


def things(*texts):
    said = "".join(f'<text name="{name}" data="{data}"/>' for name, data in texts)
    model = mujoco.MjModel.from_xml_string(ARENA.format(said))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, things_of(model, data)


def test_victims_are_alive_unless_the_text_says_otherwise():
    model, (a, b) = things(("victim_b", data_of("victim", state="dead")))
    assert [(t.name, t.kind, t.state, t.is_warm) for t in (a, b)] == [
        ("victim_a", "victim", "alive", True),
        ("victim_b", "victim", "dead", False),
    ]
    assert model.geom("box").id not in b.geoms
    assert things_of_kind([a, b], "heat") == [a] and things_of_kind([a, b], "victim") == [a, b]


def test_a_thing_has_the_place_extent_and_front_of_its_body():
    model, found = things(("sign", data_of("hazmat_sign", "poison")))
    (sign,) = things_of_kind(found, "hazmat_sign")
    assert (sign.text, sign.state, sign.geoms.tolist()) == ("poison", "", [model.geom("plate").id])
    assert_allclose(sign.box, [(-0.1, -0.2, -0.6), (0.1, 0.2, 0.0)], atol=1e-9)
    # Turned about y by 90°, its z axis is the world's x.
    assert_allclose(sign.normal, (1, 0, 0), atol=1e-9)
    assert_allclose(sign.centre, (-0.3, 1, 2), atol=1e-9)


def test_any_text_survives():
    for text in ("a=b;c%3B", "<script>&'\"", "ünï ✓", ""):
        root = Element("mujoco")
        annotate_body(root, "sign", "qr_code", text)
        said = root.find("custom/text").get("data").replace("&", "&amp;")
        assert things_of_kind(things(("sign", said))[1], "qr_code")[0].text == text
        assert text not in tostring(root, encoding="unicode") or not text


def test_texts_that_are_of_no_thing_are_passed_over():
    known = [t.name for t in things()[1]]
    others = [("shelf", "kind=shelf"), ("nobody", data_of("qr_code")), ("sign", "no words"), ("box", "kind=heat")]
    assert [t.name for t in things(*others)[1]] == known == ["victim_a", "victim_b"]
    assert "heat" in KINDS and things_of_kind(things(("sign", "kind=heat"))[1], "qr_code") == []


def test_they_survive_pymjcf_and_attachment():
    root = mjcf.from_xml_string(ARENA.format(f'<text name="sign" data="{data_of("hazmat_sign", "oxygen")}"/>'))
    world = mjcf.RootElement(model="world")
    root.model = "inner"
    world.attach(root)
    model = mujoco.MjModel.from_xml_string(world.to_xml_string())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert {(t.name, t.text) for t in things_of(model, data)} >= {("sign", "oxygen"), ("victim_a", "")}
    assert np.isfinite([t.centre for t in things_of(model, data)]).all()
