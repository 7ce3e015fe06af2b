"""Meshes in SDF worlds: the files' numbers, and what of them is solid."""

import logging

import mujoco
import numpy as np
import pytest
import trimesh

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.arenas.sdf import build
from sarsim.arenas.sdf.meshes import MeshSurface
from sarsim.arenas.sdf.pieces import extruded, pieces_of
from sarsim.ground_truth.meshes import DRAWN_GROUPS
from tests.sarsim.arenas.sdf.worlds import COLLADA, PLANE, Compiled, mesh, model, room, write

MM = 1e-3
X, Y, DOWN = (1, 0, 0), (0, 1, 0), (0, 0, -1)


@pytest.mark.parametrize("kind", ["stl", "obj"])
def test_stl_and_obj_are_scaled_and_turned(tmp_path, kind):
    trimesh.creation.box(bounds=[(0, 0, 0), (1, 2, 3)]).export(tmp_path / f"b.{kind}")
    pose = "<pose degrees='true'>5 0 0 0 0 90</pose>"
    link = mesh(f"b.{kind}", "<scale>0.5 1 -1</scale>").replace("<geometry>", f"{pose}<geometry>")
    arena = Compiled(write(tmp_path, model("m", link, pose="0 0 3 0 0 0")))
    # x from 5 - 2 to 5, y from 0 to 0.5, z from 0 to 3
    assert arena.ray(4, 0.2, 9, along=DOWN) == pytest.approx(6, abs=MM)
    assert arena.ray(0, 0.2, 1, along=X) == pytest.approx(3, abs=MM)
    assert arena.ray(4, 9, 1, along=(0, -1, 0)) == pytest.approx(8.5, abs=MM)


@pytest.mark.parametrize(
    ("axis", "x", "y", "z"),
    [
        ("<up_axis>Z_UP</up_axis>", (-1.5, 0.5), (0, 1), (0, 3)),
        ("", (-1.5, 0.5), (0, 1), (0, 3)),
        ("<up_axis>Y_UP</up_axis>", (-1.5, 0.5), (0, 1), (0, 3)),
        ("<up_axis>X_UP</up_axis>", (-1.5, 0.5), (0, 1), (0, 3)),
    ],
)
def test_collada_has_a_unit_nodes_and_colours_and_gazebo_turns_no_axis(tmp_path, axis, x, y, z):
    (tmp_path / "b.dae").write_text(COLLADA.format(axis=axis))
    arena = Compiled(write(tmp_path, PLANE, model("m", mesh("b.dae"))))
    middle = np.mean([x, y, z], axis=1)
    assert arena.ray(middle[0], middle[1], 9, along=DOWN) == pytest.approx(9 - z[1], abs=MM)
    assert arena.ray(-9, middle[1], middle[2], along=X) == pytest.approx(9 + x[0], abs=MM)
    assert arena.ray(middle[0], -9, middle[2], along=Y) == pytest.approx(9 + y[0], abs=MM)
    np.testing.assert_allclose(arena.model.mat_rgba[arena.model.geom_matid[1]], [0, 0.5, 1, 1])


def test_a_submesh_is_chosen_by_name_and_centred(tmp_path):
    (tmp_path / "b.dae").write_text(COLLADA.format(axis=""))
    chosen = "<submesh><name>slab</name><center>true</center></submesh>"
    arena = Compiled(write(tmp_path, PLANE, model("m", mesh("b.dae", chosen), pose="0 0 1.5 0 0 0")))
    assert arena.ray(-9, 0, 1.5, along=X) == pytest.approx(8, abs=MM)
    with pytest.raises(InputError, match=r"b\.dae .*'roof'"):
        build.build_sdf(write(tmp_path, model("m", mesh("b.dae", "<submesh><name>roof</name></submesh>"))))


def test_a_room_that_is_one_mesh_stays_open(tmp_path):
    room().export(tmp_path / "room.stl")
    path = write(tmp_path, PLANE, model("m", mesh("room.stl")))
    arena = Compiled(path)
    assert arena.ray(0, 0, 0.5, along=(-1, 0, 0)) == pytest.approx(1.8, abs=MM)
    assert arena.ray(0, 1, 0.5, along=X) == pytest.approx(1.8, abs=MM)
    assert arena.ray(0, 0, 0.5, along=X) == -1  # through the doorway
    assert "wall" in arena.labels
    x, y, _ = load_arena(str(path), (0, 0, 0)).T_world_start[:3, 3]
    assert (x, y) == (0, 0)


def test_what_is_seen_does_not_collide_and_what_collides_is_not_seen(tmp_path):
    room().export(tmp_path / "room.stl")
    model_ = Compiled(write(tmp_path, PLANE, model("m", mesh("room.stl")))).model
    is_mesh = model_.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    is_seen, collides = np.isin(model_.geom_group, DRAWN_GROUPS), model_.geom_contype > 0
    assert (is_seen ^ collides)[is_mesh].all() and is_seen[is_mesh].any() and collides[is_mesh].any()


def test_an_open_surface_is_seen_from_both_sides_within_1_mm(tmp_path):
    rng = np.random.default_rng(0)
    corners = rng.uniform((-3, -3, 2), (3, 3, 8), (4, 3))
    sheet = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)])
    sheet.export(tmp_path / "sheet.stl")
    arena = Compiled(write(tmp_path, PLANE, model("m", mesh("sheet.stl"), pose="1 2 0 0 0 0")))
    for point, face in zip(*trimesh.sample.sample_surface(sheet, 20, seed=0), strict=True):
        for side in (-0.5, 0.5):
            normal = side * sheet.face_normals[face]
            assert arena.ray(*(point + normal + (1, 2, 0)), along=-2 * normal) == pytest.approx(0.5, abs=MM)


def test_large_pieces_are_seen_in_tiles(tmp_path):
    count = 9
    halls = trimesh.util.concatenate([room().apply_translation((3.8 * n, 0, 0)) for n in range(count)])
    merged = trimesh.Trimesh(halls.vertices, halls.faces, process=True)
    merged.update_faces(merged.face_normals[:, 2] > -0.5)
    merged.export(tmp_path / "halls.stl")
    model_ = Compiled(write(tmp_path, PLANE, model("m", mesh("halls.stl")))).model
    is_seen = (model_.geom_contype == 0) & (model_.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    assert is_seen.sum() >= count and model_.geom_rbound[is_seen].max() < 2 * build.CUBE_SIDE


def test_closed_convex_pieces_stay_whole_and_open_ones_are_plates():
    ball, quad = trimesh.creation.icosphere(2), MeshSurface("", np.eye(4)[:, :3], np.array([(0, 1, 2)]))
    both = trimesh.util.concatenate([ball, ball.copy().apply_translation((5, 0, 0))])
    pieces = list(pieces_of(MeshSurface("", both.vertices, both.faces)))
    assert [len(piece.parts) for piece in pieces] == [1, 1]
    (plate,) = next(pieces_of(quad)).parts
    assert len(plate) == 6 and np.ptp(plate @ np.full(3, 3**-0.5)) == pytest.approx(2e-4)


def test_what_is_too_detailed_is_as_solid_as_its_hull(tmp_path, monkeypatch, caplog):
    room().export(tmp_path / "room.stl")
    monkeypatch.setattr(build, "MAX_PIECES", 3)
    with caplog.at_level(logging.WARNING):
        arena = Compiled(write(tmp_path, PLANE, model("m", mesh("room.stl"))))
    assert "convex hull" in caplog.text
    assert (arena.model.geom_contype > 0).sum() == 2
    assert arena.ray(0, 0, 0.5, along=(-1, 0, 0)) == pytest.approx(1.8, abs=MM)  # seen as it is


def test_far_too_detailed_pieces_have_one_label_each(tmp_path, monkeypatch):
    room().export(tmp_path / "room.stl")
    monkeypatch.setattr(build, "MAX_PIECES", 3)
    monkeypatch.setattr(build, "MAX_FACETS", 3)
    arena = Compiled(write(tmp_path, PLANE, model("m", mesh("room.stl"))))
    assert arena.model.ngeom == 2
    assert arena.ray(0, 0, 0.5, along=(-1, 0, 0)) == pytest.approx(1.8, abs=MM)


def test_a_flat_piece_that_is_too_detailed_is_a_plate(tmp_path, monkeypatch):
    star = extruded(
        [np.array([(0, 1), (-0.2, 0.2), (-1, 0), (-0.2, -0.2), (0, -1), (0.2, -0.2), (1, 0), (0.2, 0.2)])], 1
    )
    trimesh.Trimesh(star.vertices, star.triangles.reshape(-1, 8, 3)[:, 1]).export(tmp_path / "star.stl")
    monkeypatch.setattr(build, "MAX_PIECES", 2)
    arena = Compiled(write(tmp_path, PLANE, model("m", mesh("star.stl"))))
    assert (arena.model.geom_contype > 0).sum() == 2
    assert arena.ray(0, 0, 2, along=DOWN) == pytest.approx(1, abs=MM)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.stl", b"nonsense", "0 triangles"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n", "cannot be read as a mesh: |triangles"),
        ("a.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "all vertices must be finite"),
        ("a.obj", b"", "cannot be read as a mesh: |0 triangles"),
        ("a.dae", b"<COLLADA/>", "cannot be read as a mesh: "),
        ("a.dae", b"<!DOCTYPE a [<!ENTITY b 'c'>]><COLLADA>&b;</COLLADA>", "declares a document type or entities"),
        ("a.fbx", b"", "format is not supported; use .stl, .obj, .dae, .glb or .gltf"),
    ],
)
def test_a_broken_mesh_is_one_line(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=said) as error:
        build.build_sdf(write(tmp_path, model("m", mesh(name))))
    assert name in str(error.value) and "\n" not in str(error.value)
