"""Files handed in for a room, scored by its truth."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.plugins.league.codes import ReadCode, write_codes
from sarsim.ground_truth.meshes import true_scene
from sarsim.plugins.league.handed_in import matched_distances, registered_error, score_handed_in, true_arena
from sarsim.robots.model import robot_model
from tests.pipeline.plugins.league.handed_in_room import BRIEF, hand_in_room, room_points

WALL = '<geom type="box" pos="{} {} 0.5" size="{} {} 0.5" user="1"/>'
WALLS = "".join(WALL.format(*p) for s in (-2.05, 2.05) for p in ((s, 0, 0.05, 2.1), (0, s, 2.1, 0.05)))
ROOM = f"""<mujoco><size nuser_geom="1"/><worldbody>
<geom type="box" pos="0 0 -0.1" size="2.1 2.1 0.1" user="2"/>{WALLS}
<body name="victim_a" pos="1.1 -1 0.2"><geom type="sphere" size="0.2" user="6"/></body>
<body name="victim_b" pos="-1.5 -1.5 0.2"><geom type="sphere" size="0.2" user="6"/></body>
<body name="sign" pos="-1 1.1 0.3"><geom type="box" size="0.1 0.01 0.1" user="7"/></body></worldbody>
<custom><text name="victim_b" data="kind=victim;text=;state=dead"/>
<text name="sign" data="kind=hazmat_sign;text=poison;state="/></custom></mujoco>"""


@pytest.fixture(scope="module")
def arena():
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # The files' robot is 0.5 m long.
    return true_arena(model, data, np.eye(4), replace(robot_model(), length=0.5))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("room")
    hand_in_room(path)
    return path


def test_both_scores_are_those_of_an_independent_computation(folder, arena):
    """The finds are two marks at 0.1 m from victim a, a sign at as much from its place, a tag of nobody."""
    score = score_handed_in(folder, arena, BRIEF, parked=np.array([0.0, -1.0]))
    rows = [line.split(",") for line in next(folder.glob("*.csv")).read_text().splitlines()[8:]]
    marks = [row for row in rows if "victim" in row[3] or "heat" in row[3]]
    # Forward is y and left is -x of the files, from 0.25 m before the robot's middle.
    errors = [np.hypot(float(row[5]) + 0.25 - 1.1, -float(row[4]) + 1) for row in marks]
    (sign,) = (row for row in rows if "poison" in row[3])
    errors.append(np.hypot(float(sign[5]) + 0.25 + 1, -float(sign[4]) - 1.1))
    assert (len(rows), len(marks)) == (4, 2)
    of_league = 1 / (1 + score["league"]["map"]["global_error_m"]) * 1.3 + 3 / (1 + np.mean(errors))
    assert score["league"]["map"]["coverage"] == 1
    assert score["league"]["total"]["points"] == pytest.approx(5 * of_league)
    # No portal in a single room; one of two victims found, the only living one, with the robot beside.
    assert score["virtual"]["total"]["points"] == pytest.approx(0.5 * 1 / 2 + 0.5 * 2 / 2)


def test_the_robot_must_be_beside_a_living_victim(folder, arena):
    for parked in (None, np.array([-1.5, -1.0])):
        assert score_handed_in(folder, arena, BRIEF, parked)["virtual"]["living"]["right"] == 0


@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (0.1, -0.05, 0.03)])
def test_a_map_that_is_only_moved_is_registered(arena, moved):
    assert registered_error(room_points() + np.array(moved), arena.scene) < 1e-4


def test_triangles_without_area_do_no_harm():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="cylinder" size="0.3 0.2"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    points = np.array([(0, 0, 0.21), (0.1, 0, 0.21), (0, 0.1, 0.21), (0, 0, -0.19)])
    assert registered_error(points, true_scene(model, data)) < 1e-4


def test_a_bent_map_keeps_its_error(arena):
    points = room_points()
    stretched = points * np.array([1.1, 1, 1])
    # The walls along y are 0.2 m off on both sides, a seventh of all points; nothing rigid mends that.
    error = registered_error(stretched, arena.scene)
    assert 0.02 < error < 0.2 and np.isclose(error, registered_error(stretched[::-1], arena.scene), rtol=0.05)


def test_a_map_in_centimetres_costs_nearly_all(arena, tmp_path):
    hand_in_room(tmp_path, 100 * room_points())
    score = score_handed_in(tmp_path, arena, BRIEF)["league"]["map"]
    assert score["global_error_m"] > 10
    assert score["points"] < 0.1


def test_a_map_of_half_the_room_covers_half(arena, tmp_path):
    points = room_points()
    hand_in_room(tmp_path, points[points[:, 0] < 0])
    # A point covers 10 cm around it, of 3.4 m across which the robot's middle can be.
    assert 0.5 < score_handed_in(tmp_path, arena, BRIEF)["league"]["map"]["coverage"] < 0.6


def test_one_find_for_one_thing():
    places = np.array([(0.0, 0, 0), (0.1, 0, 0), (3, 0, 0)])
    np.testing.assert_allclose(matched_distances(places, np.array([(0.1, 0, 0), (3.4, 0, 0)]), 0.5), [0, 0.4])
    assert len(matched_distances(places, np.zeros((0, 3)), 0.5)) == 0


def test_files_that_cannot_be_scored_are_refused(folder, arena, tmp_path):
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / BRIEF.cloud_name).write_text("no cloud")
    with pytest.raises(InputError, match=r"lab\.ply"):
        score_handed_in(tmp_path, arena, BRIEF)
    (tmp_path / BRIEF.cloud_name).unlink()
    with pytest.raises(InputError, match=r"contains no \.ply file"):
        score_handed_in(tmp_path, arena, BRIEF)


def test_codes_count_for_the_small_league_where_tubes_stand(tmp_path):
    """Two tubes before walls; of two codes that were read one hangs where the file says, the other 0.75 m off."""
    tubes = {(1.85, 0.5): np.pi / 2, (-0.5, 1.85): np.pi}  # their middles, and where what is seen of them begins
    geoms = "".join(
        f'<geom name="tube_{n}" type="cylinder" pos="{x} {y} 0.5" size="0.15 0.5" user="1"/>'
        for n, (x, y) in enumerate(tubes)
    )
    code = '<body name="{0}" pos="{1}"><geom size="0.05 0.05 0.001" type="box" user="7"/></body>'
    said = '<text name="{0}" data="kind=qr_code;text={0};state="/>'
    codes = code.format("A", "1 1 0.5") + code.format("B", "1 -1 0.8")
    text = ROOM.replace("<worldbody>", f"<worldbody>{geoms}{codes}")
    text = text.replace("<custom>", "<custom>" + said.format("A") + said.format("B"))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    truth = true_arena(model, data, np.eye(4), replace(robot_model(), length=0.5))
    a, z = (n.ravel() for n in np.meshgrid(np.linspace(0, np.pi, 20), np.arange(0.25, 1, 0.05)))
    seen = [
        np.stack([x + 0.15 * np.cos(a + begin), y + 0.15 * np.sin(a + begin), z], axis=1)
        for (x, y), begin in tubes.items()
    ]
    hand_in_room(tmp_path, np.concatenate([room_points(), *seen]))
    without = score_handed_in(tmp_path, truth, BRIEF)["small"]
    assert without["codes"]["right"] == 0 and without["distances"]["shown"] == 2
    # Forward is y and left is -x of the file, from 0.25 m before the robot's middle.
    read = [("A", (-1.0, 0.75, 0.5)), ("B", (1.0, 0.0, 0.5)), ("C", (0.0, 0.0, 0.5))]
    write_codes(tmp_path / BRIEF.codes_name, [ReadCode(text, np.array(place)) for text, place in read])
    small = score_handed_in(tmp_path, truth, BRIEF)["small"]
    assert (small["codes"]["present"], small["codes"]["right"], small["distances"]["right"]) == (2, 2, 1)
    assert small["total"]["points"] == 4 * (2 * 1 + 1 * 4)


def test_without_tubes_there_is_no_score_of_the_small_league(folder, arena):
    assert set(score_handed_in(folder, arena, BRIEF)) == {"league", "virtual"}
