"""The models of an SDF world: which there are, where they stand, and which are missing."""

from math import pi

import numpy as np
import pytest
import trimesh

from sarsim.arenas.sdf.world import SdfWorld
from tests.sarsim.arenas.sdf.worlds import PLANE, box, include, mesh, model, write


def models_of(path):
    return {m.scoped_name: m for m in SdfWorld(path).models()}


def crowd(folder):
    """A world with models in others, from elsewhere, in part without their meshes or missing."""
    for name, link in {"person": mesh("model://person/body.dae"), "crate": box(1, 1, 1)}.items():
        (folder / name).mkdir()
        (folder / name / "model.sdf").write_text(f"<sdf version='1.6'>{model('inside', link)}</sdf>")
    trimesh.creation.box().export(folder / "a.stl")
    return write(
        folder,
        PLANE,
        include("model://person", "victim_hot", "1 2 0 0 0 0"),
        include("model://crate"),
        model("house", mesh("a.stl"), mesh("b.stl"), inside=include("model://gone/victim_cold", pose="0 1 0 0 0 0")
              + model("room", box(1, 1, 1)), pose=f"5 0 0 0 0 {pi / 2}"),
        model("frame", inside=model("door", mesh("c.stl"))),
        "<state world_name='w'><model name='house'><pose>6 0 0 0 0 0</pose></model></state>",
    )  # fmt: skip


def test_every_model_is_listed_with_its_place(tmp_path):
    models = models_of(crowd(tmp_path))
    assert list(models) == [
        "ground_plane", "victim_hot", "inside", "house", "house::victim_cold", "house::room", "frame", "frame::door",
    ]  # fmt: skip
    assert [m.name for m in models.values() if m.is_missing] == ["victim_hot", "victim_cold", "door"]
    assert models["victim_hot"].uri == "model://person" and models["house"].uri == ""
    np.testing.assert_allclose(models["victim_hot"].T_world[:3, 3], (1, 2, 0))
    np.testing.assert_allclose(models["house::victim_cold"].T_world[:3, 3], (6, 1, 0))  # as the state has the house


def test_a_mesh_that_cannot_be_read_is_missing_too(tmp_path):
    (tmp_path / "a.stl").write_bytes(b"nonsense")
    (only,) = SdfWorld(write(tmp_path, model("m", mesh("a.stl")))).models()
    assert only.is_missing


@pytest.mark.parametrize("chosen", ["house", "house::room", "victim_hot"])
def test_a_model_can_be_left_out_with_all_in_it(tmp_path, chosen):
    world = SdfWorld(crowd(tmp_path))
    every = [shape.model for shape in world.shapes()]
    left = [shape.model for shape in world.shapes(without=lambda m: m.scoped_name == chosen)]
    assert left == [name for name in every if not f"{name}::".startswith(f"{chosen}::")] != every


def test_what_is_missing_of_a_model_left_out_is_no_loss(tmp_path):
    path = crowd(tmp_path)
    for choice, count in ((lambda m: False, 1), (lambda m: m.name == "victim_cold", 0)):
        world = SdfWorld(path)
        list(world.shapes(without=choice))
        assert sum("gone" in uri for uri in world.missing) == count
