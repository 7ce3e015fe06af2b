"""Untrusted XML files: refused with one line, before anything expands them."""

import os

import pytest

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.vetting import model_files
from sarsim.vetting.model_files import check_files, parse_xml

BOMB = (
    "<!DOCTYPE mujoco ["
    + "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10 if n else "boom"}">' for n in range(12))
    + "]><mujoco model='&e11;'><worldbody/></mujoco>"
)
EXTERNAL = '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hosts">]><mujoco model="a">&b;</mujoco>'
OUTSIDE = '<!DOCTYPE mujoco SYSTEM "http://127.0.0.1:9/a.dtd"><mujoco/>'
PARAMETER = '<!DOCTYPE a [<!ENTITY % b SYSTEM "file:///etc/hosts"> %b;]><mujoco/>'


@pytest.mark.parametrize(
    "text", [BOMB, EXTERNAL, OUTSIDE, PARAMETER], ids=["bomb", "entity", "document type", "parameter"]
)
def test_entities_are_refused_where_they_stand_and_in_files_that_are_drawn_in(text, tmp_path):
    (tmp_path / "bad.xml").write_text(text)
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "first.xml").write_text('<mujoco><include file="second.xml"/></mujoco>')
    (tmp_path / "deeper" / "second.xml").write_text(text)
    (tmp_path / "include.xml").write_text('<mujoco><include file="bad.xml"/></mujoco>')
    (tmp_path / "deep.xml").write_text('<mujoco><include file="deeper/first.xml"/></mujoco>')
    (tmp_path / "attach.xml").write_text('<mujoco><asset><model name="m" file="bad.xml"/></asset></mujoco>')
    for name, where in (("bad", "bad"), ("include", "bad"), ("deep", "second"), ("attach", "bad")):
        with pytest.raises(InputError, match=rf"{where}\.xml: refused") as error:
            load_arena(str(tmp_path / f"{name}.xml"))
        assert "\n" not in str(error.value)


def test_a_file_that_is_too_large_or_no_xml_is_refused(tmp_path):
    path = tmp_path / "arena.xml"
    path.write_text("<mujoco/>")
    assert parse_xml(path, 9).tag == "mujoco"
    with pytest.raises(InputError, match="8 bytes"):
        parse_xml(path, 8)
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"arena\.xml"):
        parse_xml(path, 1000)
    path.write_text('<?xml version="1.0" encoding="klingon"?><mujoco/>')
    with pytest.raises(InputError, match="klingon"):
        parse_xml(path, 1000)


def test_files_that_include_each_other_are_parsed_once(tmp_path):
    (tmp_path / "a.xml").write_text('<mujoco><include file="b.xml"/></mujoco>')
    (tmp_path / "b.xml").write_text('<mujoco><include file="a.xml"/></mujoco>')
    check_files(tmp_path / "a.xml")


def test_copies_of_copies_are_counted_before_they_are_made(tmp_path):
    def arena(count):
        inner = f'<replicate count="{count}" offset="1 0 0"><geom size="0.1"/></replicate>'
        outer = f'<replicate count="{count}" offset="0 1 0">{inner}</replicate>'
        (tmp_path / "a.xml").write_text(f"<mujoco><worldbody>{outer}</worldbody></mujoco>")
        return tmp_path / "a.xml"

    check_files(arena(70))
    with pytest.raises(InputError, match="6400 geoms, including copies; the limit is 6000"):
        check_files(arena(80))


def test_copies_of_more_digits_than_a_number_has_are_left_to_mujoco(tmp_path):
    (tmp_path / "a.xml").write_text(f'<mujoco><replicate count="{"9" * 5000}"><geom/></replicate></mujoco>')
    check_files(tmp_path / "a.xml")


@pytest.mark.parametrize(
    "element",
    [
        '<asset><mesh file="/dev/zero"/></asset>',
        '<asset><texture fileup="/etc/passwd"/></asset>',
        '<asset><texture file="../secret.png"/></asset>',
        '<asset><mesh file="link.stl"/></asset>',
        '<compiler meshdir=".."/><asset><mesh file="secret.png"/></asset>',
        '<include file="../other.xml"/>',
    ],
)
def test_files_outside_the_folder_are_not_opened(element, tmp_path):
    (tmp_path / "secret.png").write_text("secret")
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "link.stl").symlink_to(tmp_path / "secret.png")
    (tmp_path / "model" / "a.xml").write_text(f"<mujoco>{element}</mujoco>")
    with pytest.raises(InputError, match=r"a\.xml: .*outside"):
        check_files(tmp_path / "model" / "a.xml")


def test_what_a_model_refers_to_is_a_file_of_bounded_size(tmp_path, monkeypatch):
    (tmp_path / "meshes").mkdir()
    mesh = tmp_path / "meshes" / "m.stl"
    mesh.write_bytes(bytes(1000))
    (tmp_path / "a.xml").write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh file="m.stl"/></asset></mujoco>'
    )
    check_files(tmp_path / "a.xml")
    monkeypatch.setattr(model_files, "MAX_MODEL_BYTES", 1000)
    with pytest.raises(InputError, match="too large"):
        check_files(tmp_path / "a.xml")
    mesh.unlink()
    os.mkfifo(mesh)
    with pytest.raises(InputError, match=r"m\.stl"):
        check_files(tmp_path / "a.xml")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.urdf", '<robot name="a"><link name="b"/></robot>', r"a\.urdf: is URDF .* convert it"),
        ("a.xml", '<robot name="a"><link name="b"/></robot>', r"a\.xml: is URDF .* convert it"),
        ("a.xacro", "<mujoco/>", r"a\.xacro: .* end in \.xml or \.mjcf; rename it"),
    ],
)
def test_other_formats_are_named(name, text, said, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=said):
        check_files(tmp_path / name)
