"""Victims of SDF worlds."""

import logging
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline.labels import Label
from sarsim.arenas.load import load_arena
from sarsim.arenas.settings import WorldVictims
from sarsim.arenas.things.thing import Thing, things_of
from sarsim.sensors.camera import geom_labels

GROUND = (
    "<model name='ground'><link name='l'><collision name='c'><pose>0 0 -0.1 0 0 0</pose><geometry><box><size>12 8 0.2"
    "</size></box></geometry></collision></link></model>"
)
LYING = (
    "<link name='l'><pose>0 0 0.2 0 0 0</pose><visual name='v'><geometry><box><size>1.6 0.4 0.3</size></box>"
    "</geometry><material><diffuse>0.9 0.1 0.1 1</diffuse></material></visual></link>"
)


def world(folder: Path, models: str) -> Path:
    path = folder / "hall.world"
    path.write_text(f"<sdf version='1.6'><world name='hall'>{GROUND}{models}</world></sdf>")
    return path


def loaded(path: Path, victims: WorldVictims | None = None) -> tuple[mujoco.MjModel, list[Thing]]:
    arena = load_arena(str(path), victims=victims)
    model = mujoco.MjModel.from_xml_string(arena.to_xml(), arena.mjcf_model.get_assets())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, things_of(model, data)


def test_a_victim_is_as_its_model_is(tmp_path: Path) -> None:
    path = world(tmp_path, f"<model name='victim_hot_1'><pose>2 1 0 0 0 1.5707963</pose>{LYING}</model>")
    model, (victim,) = loaded(path)
    assert victim.state == "alive"
    np.testing.assert_allclose(victim.centre, (2, 1, 0.2), atol=1e-3)
    np.testing.assert_allclose(np.ptp(victim.box, axis=0), (0.4, 1.6, 0.3), atol=1e-3)
    assert (geom_labels(model)[victim.geoms] == Label.VICTIM).all()
    assert (geom_labels(model) == Label.VICTIM).sum() == 1  # nothing of it stands in the arena a second time


def test_the_folder_of_a_model_says_it_too(tmp_path: Path) -> None:
    (tmp_path / "victim_cold").mkdir()
    (tmp_path / "victim_cold" / "model.sdf").write_text(f"<sdf version='1.6'><model name='m'>{LYING}</model></sdf>")
    include = "<include><uri>model://victim_cold</uri><name>anna</name><pose>-2 0 0 0 0 0</pose></include>"
    (victim,) = loaded(world(tmp_path, include), WorldVictims(state="alive"))[1]
    assert victim.state == "dead"
    np.testing.assert_allclose(victim.centre[:2], (-2, 0), atol=1e-3)


@pytest.mark.parametrize(
    "model",
    [
        "<include><uri>model://victim</uri><pose>1 -2 0 1.57 0 0.5</pose></include>",
        "<model name='victimWoman'><pose>1 -2 0 1.57 0 0.5</pose><link name='defaultModel_0::custom_0'>"
        "<visual name='v'><geometry><mesh><uri>model://victim/girl.dae</uri></mesh></geometry></visual></link></model>",
    ],
)
def test_a_person_lies_where_the_mesh_is_missing(
    model: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        (victim,) = loaded(world(tmp_path, model))[1]
    np.testing.assert_allclose(victim.centre[:2], (1, -2), atol=0.05)
    assert victim.T_world_thing[1, 0] == pytest.approx(np.sin(0.5), abs=1e-3)
    assert victim.state == "dead"
    assert len([r for r in caplog.records if "victim" in r.getMessage()]) == 2  # the person, and its state


def test_a_victim_of_no_shape_at_all_is_none(tmp_path: Path) -> None:
    """As where somebody took the tags off the state that Gazebo saved: its models are names and poses alone."""
    saved = (
        "<model name='victim_hot'><pose>1 1 0 0 0 0</pose><link name='l'><pose>1 1 0.2 0 0 0</pose></link></model>"
    )
    (victim,) = loaded(world(tmp_path, f"{saved}<model name='victim_hot'>{LYING}</model>"))[1]
    np.testing.assert_allclose(victim.centre[:2], (0, 0), atol=1e-3)


def test_victims_beyond_what_is_built_of_a_large_world_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    road = GROUND.replace("12 8 0.2", "400 300 0.2")
    victims = [
        f"<model name='{n}_victim'><pose>{x} 0 0 0 0 0</pose>{LYING}</model>" for n, x in (("a", 5), ("b", 150))
    ]
    victims.append("<include><uri>model://victim</uri><name>c</name><pose>0 -120 0 0 0 0</pose></include>")
    path = world(tmp_path, "".join(victims))
    path.write_text(path.read_text().replace(GROUND, road))
    with caplog.at_level(logging.WARNING):
        (victim,) = loaded(path)[1]
    assert victim.centre[0] == pytest.approx(5, abs=1e-3)
    assert any("b_victim at (150, 0)" in line and "c at (0, -120)" in line for line in caplog.messages)


def test_ground_reaches_to_the_victims(tmp_path: Path) -> None:
    """Also where the building around them is missing."""
    plane = "<include><uri>model://ground_plane</uri></include>"
    path = world(tmp_path, "<include><uri>model://victim</uri><pose>20 30 0 0 0 0</pose></include>")
    path.write_text(path.read_text().replace(GROUND, plane + GROUND.replace("12 8 0.2", "1 1 0.2")))
    model, _ = loaded(path)
    (ground,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    assert (model.geom_pos[ground, :2] + model.geom_size[ground, :2] >= (21, 31)).all()


def test_victims_alone_lie_on_a_floor(tmp_path: Path) -> None:
    path = world(tmp_path, f"<include><uri>model://hall</uri></include><model name='victim_hot'>{LYING}</model>")
    path.write_text(path.read_text().replace(GROUND, ""))
    model, (victim,) = loaded(path)
    assert victim.state == "alive" and (geom_labels(model) == Label.TERRAIN).any()


def test_victims_in_a_victim_are_one(tmp_path: Path) -> None:
    inner = f"<model name='victim_arm'>{LYING}</model>"
    assert len(loaded(world(tmp_path, f"<model name='victim'>{LYING}{inner}</model>"))[1]) == 1
