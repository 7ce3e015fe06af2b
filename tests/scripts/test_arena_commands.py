"""The commands around arenas: they write what MuJoCo opens, and say in one line what they cannot do."""

import mujoco
import pytest

from sarsim.scripts import check_arenas as checking
from sarsim.scripts.check_arenas import check_arenas
from sarsim.scripts.cli import run
from sarsim.scripts.export_arena import export_arena

RAF = (
    '<elements><element type="small_wall" x="0" y="0" rotation="0"/>'
    '<element type="half_ramp" x="2" y="0" rotation="90"/></elements>'
)


def exported(tmp_path, *flags):
    """An arena as the command wrote it."""
    out = tmp_path / "out.xml"
    run(export_arena, ["--out", str(out), *flags])
    assert sorted(p.name for p in out.parent.glob("*.part")) == []
    return mujoco.MjModel.from_xml_path(str(out))


def refused(capsys, command, *flags):
    """The one line on stderr with which a command ends."""
    with pytest.raises(SystemExit) as end:
        run(command, list(flags))
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize("name", ["nist_6x4", "esogu_52x15"])
def test_a_built_in_arena_is_written_whole(name, tmp_path):
    model = exported(tmp_path, "--arena", name)
    assert model.nbody > 2 and model.nv == 0
    assert mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "start") >= 0
    assert (model.geom_user[:, 0] > 0).all()


def test_a_raf_file_is_written_with_the_start_wished_for(tmp_path):
    path = tmp_path / "arena.raf"
    path.write_text(RAF)
    model = exported(tmp_path, "--arena", str(path), "--start", "-0.1", "-0.2", "90")
    assert sorted(model.geom_user[:, 0]) == [1, 2, 3]
    assert model.site("start").pos.tolist() == [-0.1, -0.2, 0]


def test_a_random_arena_is_written_as_its_flags_say(tmp_path):
    flags = ("--random.columns", "3", "--random.rows", "4", "--random.victims", "0", "--random.ceiling")
    model = exported(tmp_path, "--arena", "random:1", *flags)
    assert 5 in model.geom_user[:, 0] and 6 not in model.geom_user[:, 0]
    assert model.geom("ceiling").size[:2].tolist() == pytest.approx([1.8, 2.4], abs=0.01)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("bad.raf", "<elements><element", "bad.raf: not readable XML"),
        ("bomb.raf", '<!DOCTYPE a [<!ENTITY b "c">]><elements>&b;</elements>', "bomb.raf: refused"),
        ("unknown.raf", RAF.replace("small_", "x").replace("half_", "y"), "known type: xwall, yramp"),
        ("far.raf", RAF.replace('"2"', '"1e9"'), "element 2: x='1e9'"),
        ("bomb.xml", '<!DOCTYPE a [<!ENTITY b "c">]><mujoco>&b;</mujoco>', "bomb.xml: refused"),
        ("bad.xml", "<mujoco><worldbody><geom/></worldbody></mujoco>", "bad.xml: not a readable MJCF file"),
    ],
)
def test_a_bad_arena_is_refused_and_nothing_written(name, text, said, tmp_path, capsys):
    (tmp_path / name).write_text(text)
    out = tmp_path / "out.xml"
    assert said in refused(capsys, export_arena, "--arena", str(tmp_path / name), "--out", str(out))
    assert not out.exists()


def test_what_cannot_be_written_is_refused(tmp_path, capsys):
    flags = ("--arena", "nist_6x4", "--out", str(tmp_path / "none" / "out.xml"))
    assert "cannot be written" in refused(capsys, export_arena, *flags)


def test_arenas_are_checked(monkeypatch, capsys):
    small = ["--seeds", "2", "--random.columns", "3", "--random.rows", "3", "--random.victims", "0"]
    run(check_arenas, small)
    assert "2 arenas, 0 fail a check" in capsys.readouterr().out
    monkeypatch.setattr(checking, "failed_checks", lambda mjcf: ["the start is not free"])
    with pytest.raises(SystemExit) as end:
        run(check_arenas, small)
    assert end.value.code == 1
    assert "2 fail a check" in capsys.readouterr().out


def test_no_arena_is_no_number_of_arenas_to_check(capsys):
    assert "--seeds 0" in refused(capsys, check_arenas, "--seeds", "0")
