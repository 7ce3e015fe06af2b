"""The commands around arenas: they write files that MuJoCo opens, and refuse bad input with one line."""

import mujoco
import numpy as np
import pytest
from PIL import Image

from sarsim.arenas.load import load_arena
from sarsim.arenas.things.thing import things_of
from sarsim.commands.export_arena import ExportArenaConfig, export_arena
from sarsim.commands.settings import run_with_settings
from tests.sarsim.arenas.sdf.worlds import PLANE, box, model, write

RAF = (
    '<elements><element type="small_wall" x="0" y="0" rotation="0"/>'
    '<element type="half_ramp" x="2" y="0" rotation="90"/></elements>'
)


def exported(tmp_path, *flags):
    """An arena as the command wrote it."""
    out = tmp_path / "out.xml"
    run_with_settings(export_arena, ExportArenaConfig, ["--out", str(out), *flags])
    assert sorted(p.name for p in out.parent.glob("*.part")) == []
    return mujoco.MjModel.from_xml_path(str(out))


@pytest.mark.parametrize("name", ["nist_6x4", "random:1"])
def test_what_was_written_is_an_arena_again(name, tmp_path):
    before = exported(tmp_path, "--arena", name)
    again = load_arena(str(tmp_path / "out.xml"))
    assert np.allclose(again.T_world_start, load_arena(name).T_world_start, rtol=0, atol=1e-12)
    after = mujoco.MjModel.from_xml_string(again.to_xml(), again.mjcf_model.get_assets())
    assert np.array_equal(after.tex_data, before.tex_data)
    for values in ("geom_pos", "geom_quat", "geom_size", "geom_user", "geom_friction", "mat_rgba"):
        assert np.allclose(getattr(after, values), getattr(before, values), rtol=0, atol=1e-12), values


def test_it_says_what_it_wrote_in_one_line(tmp_path, capsys):
    exported(tmp_path, "--arena", "random:1")
    (line,) = capsys.readouterr().out.splitlines()
    assert "random:1" in line and f"--mjcf={tmp_path / 'out.xml'}" in line


def test_a_raf_file_is_written_with_the_start_that_is_asked_for(tmp_path):
    path = tmp_path / "arena.raf"
    path.write_text(RAF)
    model = exported(tmp_path, "--arena", str(path), "--start", "-0.1", "-0.2", "90")
    assert sorted(model.geom_user[:, 0]) == [1, 2, 3]
    assert model.site("start").pos.tolist() == [-0.1, -0.2, 0]


def test_a_world_and_a_map_are_written(tmp_path):
    wall = box(3, 0.1, 1, "0 1 0.5 0 0 0")
    world = exported(tmp_path, "--arena", str(write(tmp_path, PLANE, model("m", wall))), "--start", "0", "0", "0")
    assert world.geom_user[:, 0].tolist() == [2, 1]
    assert world.geom("wall_1").pos.tolist() == [0, 1, 0.5]
    pixels = np.zeros((8, 9), np.uint8)
    pixels[1:-1, 1:-1] = 254
    Image.fromarray(pixels).save(tmp_path / "plan.pgm")
    (tmp_path / "plan.yaml").write_text("image: plan.pgm\nresolution: 0.5\norigin: [-1, 0, 0]\n")
    plan = exported(tmp_path, "--arena", str(tmp_path / "plan.yaml"))
    assert plan.geom_user[:, 0].tolist() == [2, 1, 1, 1, 1]


def test_a_random_arena_is_written_as_its_settings_say(tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text("arena: random:1\nrandom: {columns: 3, rows: 4, victims: 0, ceiling: true}\n")
    model = exported(tmp_path, "--config", str(config))
    assert 5 in model.geom_user[:, 0] and 6 not in model.geom_user[:, 0]
    assert model.geom("ceiling").size[:2].tolist() == pytest.approx([1.8, 2.4], abs=0.01)


def test_the_pictures_of_signs_and_codes_are_written_beside_the_arena(tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text("arena: random:1\nrandom: {columns: 3, rows: 4, victims: 1, things: 4}\n")
    model = exported(tmp_path, "--config", str(config))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    kinds = [thing.kind for thing in things_of(model, data)]
    assert kinds == ["victim", "victim", "hazmat_sign", "qr_code", "april_tag"]
    assert len(list(tmp_path.glob("*.png"))) == 3
