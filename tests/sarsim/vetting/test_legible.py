"""XML that Gazebo and MuJoCo read, although the standard forbids it."""

import time

import mujoco
import pytest

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.vetting.model_files import parse_xml

ARENA = b"""<mujoco><size nuser_geom="1"/>%s<worldbody><geom type="plane" size="4 4 .1" user="2"/>
<geom name="wall" type="box" size="1 .1 .5" pos="2 0 .5" user="1"/><site name="start"/></worldbody></mujoco>"""
ODD = {
    "ampersand": b'<custom><text name="by" data="Tom & Jerry, R&D"/></custom>',
    "unknown entity": b'<custom><text name="by" data="a &nbsp; b"/></custom>',
    "Latin-1": b"<!-- caf\xe9 -->",
    "Latin-1 in a name": b'<custom><text name="caf\xe9" data="\xe9"/></custom>',
    "dashes": b"<!-- a -- b --- -->",
    "no space": b'<custom><text name="a"data="b"/></custom>',
    "less than": b'<custom><text name="a" data="x < y"/></custom>',
    "control character": b"<!-- a \x01 b -->",
    "prefix": b"",
}

pytestmark = pytest.mark.usefixtures("unisolated")


def read(tmp_path, content):
    (tmp_path / "a.xml").write_bytes(content)
    return parse_xml(tmp_path / "a.xml")


@pytest.mark.parametrize("kind", ODD)
def test_what_mujoco_reads_loads(kind, tmp_path):
    path = tmp_path / "a.xml"
    path.write_bytes((b"\n  " if kind == "prefix" else b"") + b'<?xml version="1.0"?>' + ARENA % ODD[kind])
    mujoco.MjModel.from_xml_path(str(path))
    assert load_arena(str(path)).mjcf_model.find("geom", "wall") is not None


def test_the_content_is_what_stands_there(tmp_path):
    content = b'<sdf version="1.4"a="R&D" a="2" b="x<y"><!-- -- --><d>caf\xe9 & &foo;</d></sdf>'
    root = read(tmp_path, b"\n<?xml version='1.0'?>" + content)
    assert root.attrib == {"version": "1.4", "a": "R&D", "b": "x<y"}
    assert [(e.tag, e.text) for e in root] == [("d", "café & &foo;")]
    assert read(tmp_path, b"<a><gz:b c:d='1'/><e/></a>")[1].tag == "e"
    assert read(tmp_path, b"<a><!-- <b/> -- --><![CDATA[<c> & ]]></a>").text == "<c> & "
    assert [e.tag for e in read(tmp_path, b"<a><b></b><c/></a>\n<d><e/></d> notes & such").iter()] == ["a", "b", "c"]


@pytest.mark.parametrize(
    "content",
    [
        b"<a><b></a>",
        b"<a & ><b>",
        b"<a b=1/>",
        b"<a>&",
        b"<a><!-- & </a>",
        b"<a>& <b</a>",
        b"plain & text",
        b"",
        b"<a b='&/>",
    ],
)
def test_what_is_broken_for_all_stays_refused(content, tmp_path):
    with pytest.raises(InputError, match=r"a\.xml: cannot be parsed as XML: "):
        read(tmp_path, content)


@pytest.mark.parametrize("before", [b"\n<?xml version='1.0'?>", b"<!-- -- -->", b"<!-- & \xe9 -->"])
def test_entities_stay_refused_in_what_is_mended(before, tmp_path):
    with pytest.raises(InputError, match="refused"):
        read(tmp_path, before + b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b; & </a>')


@pytest.mark.parametrize("unit", [b"<!--", b"<?", b"<![CDATA[", b'<a b="', b"<a ", b"<", b"&", b'b="1"'])
def test_mending_takes_time_that_grows_with_the_size_alone(unit, tmp_path):
    before = time.process_time()
    with pytest.raises(InputError):
        read(tmp_path, b"<a " + unit * (3_000_000 // len(unit)))
    assert time.process_time() - before < 20
