"""Worlds, meshes and maps of strangers, mutated at random: an arena or one line."""

import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image

from pipeline.errors import InputError
from sarsim.arenas.map_2d import build_map
from sarsim.arenas.sdf.build import build_sdf
from tests.sarsim.arenas.sdf.worlds import COLLADA, PLANE, box, mesh, model, room, write

COUNT = 9  # mutations of a file


def meshes(folder):
    room().export(folder / "a.stl")
    trimesh.creation.box().export(folder / "a.obj")
    (folder / "a.dae").write_text(COLLADA.format(axis="<up_axis>Y_UP</up_axis>"))
    links = [mesh("a.stl"), mesh("a.obj", "<scale>1 2 0.1</scale>"), mesh("a.dae"), box(1, 1, 1, "0 0 1 0.1 0 2")]
    polyline = "<polyline><point>0 0</point><point>1 0</point><point>0 1</point><height>1</height></polyline>"
    cone = "<cone><radius>1</radius><length>1</length></cone>"
    links += [f"<collision name='c'><geometry>{form}</geometry></collision>" for form in (polyline, cone)]
    return write(folder, PLANE, model("m", *links, pose="1 0 0 0 0 1", inside=model("n", box(1, 2, 0.1))))


def plan(folder):
    image = np.zeros((9, 12), np.uint8)
    image[1:-1, 1:-1] = 254
    Image.fromarray(image).save(folder / "m.pgm")
    Image.fromarray(image).save(folder / "m.png")
    path = folder / "map.yaml"
    path.write_text("image: m.png\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n")
    return path


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("files", "build", "name"),
    [(meshes, build_sdf, name) for name in ("a.world", "a.stl", "a.obj", "a.dae")]
    + [(plan, build_map, name) for name in ("map.yaml", "m.png")],
)
def test_a_mutated_file_is_an_arena_or_one_line(tmp_path, files, build, name, caplog):
    path, results = files(tmp_path), []
    good = (tmp_path / name).read_bytes()
    for seed in range(COUNT):
        rng, mutated = np.random.default_rng(seed), bytearray(good)
        for place in rng.integers(len(good), size=rng.integers(1, 20)):
            mutated[place] = rng.integers(256)
        (tmp_path / name).write_bytes(mutated[: rng.integers(len(good))] if rng.random() < 0.2 else mutated)
        try:
            mujoco.MjModel.from_xml_string(build(path).to_xml())
        except InputError as error:
            assert "\n" not in str(error) and str(tmp_path) in str(error)
            results.append(str(error))
    said = caplog.messages
    assert results or said
    assert all("\n" not in line and str(tmp_path) in line for line in said)
