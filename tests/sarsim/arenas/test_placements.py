"""Lists of victims and starts beside a world."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.arenas.placements import is_victim, read_placements, state_of
from sarsim.arenas.settings import WorldVictims
from sarsim.arenas.things.thing import ALIVE, DEAD, things_of
from sarsim.methods.arena import make_arena

HALL = (
    "<sdf version='1.6'><world name='hall'><model name='ground'><link name='l'><collision name='c'><geometry>"
    "<box><size>12 8 0.2</size></box></geometry><pose>0 0 -0.1 0 0 0</pose></collision></link></model></world></sdf>"
)


def written(folder: Path, text: str) -> Path:
    path = folder / "list.txt"
    path.write_text(text)
    return path


def test_the_leagues_form(tmp_path: Path) -> None:
    listed = read_placements(
        written(
            tmp_path,
            """# preliminary 2
            victims:
            24.0 -0.1 0 1.57 0 0
            victim_2_hot, 11.0, -3.0, 0, 1.57, 0, 1.57   # behind the desk
            3 (5.5, 6.5, 0.1) (0, 0, 2)
            starts
            2 -2 0.3 0 0 1.57
            2 5 5 0
            robot1: 4 4 0
            """,
        )
    )
    assert [(v.x, v.y, v.z, v.yaw) for v in listed.victims[:2]] == [(24, -0.1, 0, 0), (11, -3, 0, 1.57)]
    assert state_of(listed.victims[1].name) == ALIVE
    assert [(s.x, s.y, s.yaw) for s in listed.starts] == [(2, -2, 1.57), (5, 5, 0), (4, 4, 0)]
    assert listed.start == pytest.approx((2, -2, 89.95), abs=0.01)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "only words\n",
        "1 2\n",
        "victim 1.5 2 3 4\n",
        "victim nan 2 3\n",
        "victim 1 2 1e9\n",
        "1 2 3 4 5 6 7.5 8\n",
    ],
)
def test_lists_that_give_no_place(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"list\.txt"):
        read_placements(written(tmp_path, text))


def test_names_say_who_is_a_victim_and_its_state() -> None:
    assert is_victim("victimWoman") and is_victim("Victim 3") and is_victim("Rescue Randy")
    assert not is_victim("vicinity") and not is_victim("hot_plate")
    states = {"victim_hot": ALIVE, "victim_moving_2": ALIVE, "VictimCold": DEAD, "victim": "", "victim_photo": ""}
    assert {name: state_of(name) for name in states} == states


def test_people_lie_where_the_list_has_them(tmp_path: Path) -> None:
    world = tmp_path / "hall.world"
    world.write_text(HALL)
    places = written(tmp_path, "start -4 0 0 0 0 0\nvictim_hot 2 1 0 0 0 1.57\nvictim 4 -2 0\n")
    arena = load_arena(str(world), victims=WorldVictims(places, "dead"))
    model = mujoco.MjModel.from_xml_string(arena.to_xml(), arena.mjcf_model.get_assets())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hot, cold = things_of(model, data)
    assert hot.state == ALIVE and cold.state == DEAD
    np.testing.assert_allclose([hot.centre[:2], cold.centre[:2]], [(2, 1), (4, -2)], atol=0.05)
    assert hot.T_world_thing[1, 0] > 0.99  # the head is towards +y
    np.testing.assert_allclose(arena.T_world_start[:2, 3], (-4, 0))


def test_a_requested_start_replaces_only_the_start_of_the_list(tmp_path: Path) -> None:
    world = tmp_path / "hall.world"
    world.write_text(HALL)
    places = written(tmp_path, "start -4 0 0\nvictim 2 1 0\n")
    arena = load_arena(str(world), (3.0, -2.0, 0.0), victims=WorldVictims(places, "alive"))
    np.testing.assert_allclose(arena.T_world_start[:2, 3], (3, -2))
    model = mujoco.MjModel.from_xml_string(arena.to_xml(), arena.mjcf_model.get_assets())
    (victim,) = things_of(model, mujoco.MjData(model))
    assert victim.state == ALIVE


def test_arenas_that_have_their_own_people(tmp_path: Path) -> None:
    places = written(tmp_path, "victim 1 1 0\n")
    for arena in ("nist_6x4", "random:1", "lanes/traverse"):
        with pytest.raises(InputError, match="--victims"):
            make_arena(arena, victims=WorldVictims(places))
