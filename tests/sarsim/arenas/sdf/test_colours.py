"""Colours of shapes: written, by the names of Gazebo's materials, of textures and of meshes."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from sarsim.arenas.sdf.world import SdfWorld
from tests.sarsim.arenas.sdf.worlds import COLLADA, PLANE, Compiled, box, mesh, model, write

OBJ = """mtllib a.mtl
o roof
v 0 0 1\nv 1 0 1\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1
usemtl red\nf 1/1 2/2 3/3
o floor
v 0 0 0\nv 1 0 0\nv 1 1 0
usemtl brick\nf 4/1 5/2 6/3
"""


def painted(material, link=None):
    return (link or box(1, 1, 1, tag="visual")).replace("</visual>", f"<material>{material}</material></visual>")


def colour(folder, material):
    (shape,) = SdfWorld(write(folder, model("m", painted(material)))).shapes()
    return shape.colour


def colours_of(path):
    arena = Compiled(path)
    return {
        tuple(np.round(arena.model.mat_rgba[m, :3].astype(np.float64), 2).tolist())
        for m in arena.model.geom_matid[1:]
    }


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        ("<ambient>1 0 0 1</ambient><diffuse>0 0.5 0 1</diffuse>", (0, 0.5, 0)),
        ("<ambient>0.2 0.3 0.4 1</ambient>", (0.2, 0.3, 0.4)),
        (
            "<script><uri>file://media/materials/scripts/gazebo.material</uri><name>Gazebo/Blue</name></script>",
            (0, 0, 1),
        ),
        ("<script><name>Gazebo/RedTransparent</name></script>", (1, 0, 0)),
        ("<script><name>Gazebo/Unheard</name></script><diffuse>0 1 1 1</diffuse>", (0, 1, 1)),
        ("<diffuse>red</diffuse>", None),
        ("<script><uri>model://missing/materials</uri><name>Own</name></script>", None),
    ],
)
def test_a_colour_is_written_or_named(tmp_path, material, expected):
    found = colour(tmp_path, material)
    assert found is None if expected is None else np.allclose(found, expected)


def test_a_models_own_scripts_and_textures_give_a_colour(tmp_path):
    scripts, textures = tmp_path / "m" / "materials" / "scripts", tmp_path / "m" / "materials" / "textures"
    scripts.mkdir(parents=True)
    textures.mkdir()
    (scripts / "m.material").write_text(
        "material Own/Plain\n{\n technique\n {\n pass\n {\n ambient 1 0 0 1\n diffuse 0 1 0 1\n}\n}\n}\n"
        "material Own/Tiles : Base\n{\n technique {\n pass {\n diffuse 1 1 1 1\n texture_unit {\n texture t.png\n}}}}"
    )
    Image.new("RGB", (100, 70), (51, 102, 153)).save(textures / "t.png")
    uris = "<uri>model://m/materials/scripts</uri><uri>model://m/materials/textures</uri>"
    for name, expected in {"Own/Plain": (0, 1, 0), "Own/Tiles": (0.2, 0.4, 0.6)}.items():
        np.testing.assert_allclose(
            colour(tmp_path, f"<script>{uris}<name>{name}</name></script>"), expected, atol=0.01
        )
    (scripts / "m.material").write_text("material Own/Plain\n{\n diffuse 0 1 0 1\n texture  ")  # cut off
    np.testing.assert_allclose(colour(tmp_path, f"<script>{uris}<name>Own/Plain</name></script>"), (0, 1, 0))
    pbr = "<diffuse>0.5 0.5 0.5</diffuse><pbr><metal><albedo_map>{}</albedo_map></metal></pbr>"
    found = colour(tmp_path, pbr.format("model://m/materials/textures/t.png"))
    np.testing.assert_allclose(found, (0.1, 0.2, 0.3), atol=0.01)
    (textures / "t.png").write_bytes(b"no picture")
    assert colour(tmp_path, pbr.format("model://m/materials/textures/t.png")) == (0.5, 0.5, 0.5)


def test_obj_has_the_colours_of_its_materials_and_submeshes_by_the_names_of_objects(tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl brick\nmap_Kd t.png\n")
    Image.new("RGB", (8, 8), (0, 51, 255)).save(tmp_path / "t.png")
    assert colours_of(write(tmp_path, PLANE, model("m", mesh("a.obj")))) == {(1, 0, 0), (0, 0.2, 1)}
    roof = mesh("a.obj", "<submesh><name>roof</name></submesh>")
    assert colours_of(write(tmp_path, PLANE, model("m", roof))) == {(1, 0, 0)}
    (tmp_path / "a.mtl").unlink()
    assert Compiled(write(tmp_path, PLANE, model("m", mesh("a.obj")))).model.ngeom >= 3


def test_collada_has_the_mean_of_its_texture_and_the_worlds_material_counts_first(tmp_path):
    image = "<library_images><image id='i'><init_from>t.png</init_from></image></library_images><library_effects>"
    surface = (
        "<newparam sid='s'><surface type='2D'><init_from>i</init_from></surface></newparam><newparam sid='p'>"
        "<sampler2D><source>s</source></sampler2D></newparam><technique sid='t'>"
    )
    dae = COLLADA.format(axis="").replace("<library_effects>", image)
    dae = dae.replace('<technique sid="t">', surface)
    dae = dae.replace("<color>0 0.5 1 1</color>", "<texture texture='p' texcoord='UV'/>")
    (tmp_path / "b.dae").write_text(dae)
    Image.new("RGB", (8, 8), (255, 0, 51)).save(tmp_path / "t.png")
    assert colours_of(write(tmp_path, PLANE, model("m", mesh("b.dae")))) == {(1, 0, 0.2)}
    red = painted("<diffuse>0 1 0 1</diffuse>", mesh("b.dae").replace("collision", "visual"))
    assert colours_of(write(tmp_path, PLANE, model("m", red))) == {(0, 1, 0)}
    (tmp_path / "t.png").unlink()
    assert Compiled(write(tmp_path, PLANE, model("m", mesh("b.dae")))).model.ngeom == 2


def test_gltf_is_read(tmp_path):
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "b.glb")
    arena = Compiled(write(tmp_path, PLANE, model("m", mesh("b.glb"))))
    assert arena.ray(0, 0, 5, along=(0, 0, -1)) == pytest.approx(3.5, abs=1e-3)
