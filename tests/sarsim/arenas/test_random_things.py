"""The things in random arenas, on request."""

from collections import Counter
from xml.etree.ElementTree import tostring

import mujoco
import numpy as np
import pytest

from sarsim.arenas.checks import failed_checks
from sarsim.arenas.random_arena import build_random
from sarsim.arenas.random_things import KINDS_IN_TURN
from sarsim.arenas.settings import RandomArenaConfig
from sarsim.arenas.things.thing import things_of
from sarsim.arenas.walls import VIEWING_DISTANCE

SMALL = {"columns": 4, "rows": 4, "victims": 1, "difficulty": 0}


@pytest.fixture(scope="module")
def builder():
    return build_random(3, RandomArenaConfig(things=7, **SMALL))


@pytest.fixture(scope="module")
def world(builder):
    model = mujoco.MjModel.from_xml_string(builder.to_xml(), builder.files)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def test_every_kind_hangs_in_its_turn(world):
    kinds = Counter(thing.kind for thing in things_of(*world))
    assert kinds == Counter("victim" if kind == "doll" else kind for kind in KINDS_IN_TURN) + Counter(victim=1)


def test_all_that_is_flat_is_seen_from_where_the_robot_can_stand(world):
    model, data = world
    geom = np.zeros(1, np.int32)
    for thing in things_of(model, data):
        if thing.kind in ("hazmat_sign", "qr_code", "april_tag"):
            eye = thing.centre + VIEWING_DISTANCE * thing.normal
            mujoco.mj_ray(model, data, eye, -thing.normal, None, 1, -1, geom, None)
            assert geom[0] in thing.geoms
            assert 0.3 < thing.centre[2] < 0.8


def test_the_arena_itself_is_the_same_without_them(builder):
    def parts(root):
        world = [(e.get("name", ""), tostring(e).strip()) for e in root.find("worldbody")]
        return [e for name, e in world if name not in said and not name.startswith(("victim_with_box", "backing_"))]

    plain = build_random(3, RandomArenaConfig(**SMALL))
    said = {text.get("name") for text in builder.root.iterfind("custom/text")}
    assert parts(plain.root) == parts(builder.root)
    assert plain.files == {} and len(builder.files) == 4


def test_the_robot_still_gets_everywhere_and_sees_everyone(builder):
    assert list(failed_checks(builder.to_xml(), builder.files)) == []


def test_nothing_stands_where_the_robot_starts():
    """Here a doll's box hung beside the start."""
    shares = {"wall_density": 0.288, "ramps": 0.219, "clutter": 0.167, "furniture": 0.051, "bulky": 0.166}
    config = RandomArenaConfig(columns=5, rows=7, victims=4, difficulty=1, things=14, **shares)
    built = build_random(289828893, config)
    assert not any("start" in fault for fault in failed_checks(built.to_xml(), built.files))


def test_the_seed_says_what_hangs_where(builder):
    again = build_random(3, RandomArenaConfig(things=7, **SMALL))
    assert again.to_xml() == builder.to_xml() and again.files == builder.files


def test_as_many_as_fit_are_hung():
    full = build_random(3, RandomArenaConfig(things=100, columns=3, rows=3, victims=0, difficulty=0))
    assert 7 < len(full.root.findall("custom/text")) < 100


def test_things_and_furniture_have_names_of_their_own():
    """Furnished arenas hold extinguishers already."""
    config = RandomArenaConfig(things=7, furniture=0.25, columns=5, rows=5, victims=1, difficulty=0)
    built = build_random(2, config)
    model = mujoco.MjModel.from_xml_string(built.to_xml(), built.files)
    assert model.ntext == len({text.get("name") for text in built.root.iterfind("custom/text")}) > 8
