"""Which things the elements of a .raf file stand for."""

import mujoco
import pytest
from numpy.testing import assert_allclose

from pipeline.tracks.find import HAZMAT_CLASSES
from sarsim.arenas.raf import build_raf
from sarsim.arenas.things.thing import things_of


@pytest.fixture
def things_in(tmp_path):
    def read(*kinds, rotation=0):
        path = tmp_path / "arena.raf"
        lines = (f'<element type="{k}" x="{2 * n}" y="0" rotation="{rotation}"/>' for n, k in enumerate(kinds))
        path.write_text(f"<elements>{''.join(lines)}</elements>")
        builder = build_raf(path)
        model = mujoco.MjModel.from_xml_string(builder.to_xml(), builder.files)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        return things_of(model, data)

    return read


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("hazmat_poison", "poison"),
        ("hazmat_dangerous-when-wet", "dangerous-when-wet"),
        ("hazmat_explosives", "explosive"),
        ("hazmat_blasting_agents", "explosive"),
        ("hazmat_fuel-oil", "flammable-liquid"),
    ],
)
def test_a_sign_has_the_class_of_its_type(kind, text, things_in):
    (sign,) = things_in(kind)
    assert (sign.kind, sign.text) == ("hazmat_sign", text)
    assert_allclose(sign.centre, (0, 0.588, 0.2), atol=1e-3)
    assert_allclose(sign.normal, (0, -1, 0), atol=1e-6)


def test_signs_without_a_class_have_one_after_the_other(things_in):
    texts = [sign.text for sign in things_in("hazmat", "hazmat_acid", "hazmat")]
    assert len(set(texts)) == 3 and set(texts) <= set(HAZMAT_CLASSES)


def test_what_hangs_turns_with_its_element(things_in):
    (code,) = things_in("small_wall_qr", rotation=90)
    assert (code.kind, code.text) == ("qr_code", "wall 1")
    assert_allclose(code.centre, (0.594, 0, 0.6), atol=1e-3)
    assert_allclose(code.normal, (-1, 0, 0), atol=1e-6)


def test_an_extinguisher_stands_on_the_floor(things_in):
    (bottle,) = things_in("fire_extinguisher")
    lowest = bottle.T_world_thing[2, 3] + bottle.box[0, 2]
    assert bottle.kind == "fire_extinguisher" and lowest == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "state", "codes"),
    [
        ("victim_with_box1", "alive", []),
        ("victim_with_box_tsc", "alive", []),
        ("victim_doll_heat_with_box", "alive", []),
        ("victim_with_box_s", "dead", []),
        ("victim_with_box_q", "dead", ["victim 1"]),
        ("victim_with_box_tq", "alive", ["victim 1"]),
        ("victim_doll_qr_with_box", "dead", ["victim 1"]),
        ("victim_1", "dead", []),
    ],
)
def test_a_doll_is_warm_if_its_type_says_so_or_nothing(kind, state, codes, things_in):
    victim, *others = things_in(kind)
    assert (victim.kind, victim.state) == ("victim", state)
    assert [(t.kind, t.text) for t in others] == [("qr_code", text) for text in codes]


def test_what_is_only_furniture_is_no_thing(things_in):
    assert things_in("small_wall", "red_barrel", "start_check", "spectator_120", "half_ramp") == []
