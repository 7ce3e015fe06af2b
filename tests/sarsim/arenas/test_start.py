"""Where the robot is set down."""

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.transforms import from_yaw, yaw_of
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.load import load_arena
from sarsim.arenas.start import find_start, start_at
from sarsim.ground_truth.true_surface import CELL, Survey


def compiled(builder):
    model = mujoco.MjModel.from_xml_string(builder.to_xml())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def corridor(length, *extra):
    """Tiles in a row along x between walls, and ``extra`` elements: (kind, x tile, degrees)."""
    builder = ArenaBuilder("corridor")
    for tile in range(length):
        for yaw in (0, 180):
            builder.add_element("small_wall", (1.2 * tile, 0, 0), yaw)
    for kind, tile, yaw in (("small_wall", 0, 90), ("small_wall", length - 1, 270), *extra):
        builder.add_element(kind, (1.2 * tile, 0, 0), yaw)
    low, high = builder.bounds
    builder.add_floor(low - 1.0, high + 1.0)
    builder.add_surroundings(low, high)
    return builder


def test_it_is_inside_the_arena_with_the_longest_way_ahead():
    start = find_start(*compiled(corridor(4)))
    x, y, z = start.position
    assert abs(y) < 0.11 and z == 0
    assert (x < 1.0 and start.yaw == 0) or (x > 2.6 and start.yaw == pytest.approx(np.pi))


def test_it_is_in_the_larger_of_two_parts():
    start = find_start(*compiled(corridor(5, ("small_wall", 1, 270))))
    assert start.position[0] > 1.8


def test_it_is_on_the_floor_and_not_on_a_deck():
    builder = corridor(6, ("ramp_17", 2, 90), ("deck_17", 3, 0), ("deck_17", 4, 0), ("deck_17", 5, 0))
    start = find_start(*compiled(builder))
    assert start.position[2] == 0 and start.position[0] < 2.4


def test_it_is_on_the_lower_of_two_levels():
    builder, rise, run = ArenaBuilder("levels"), 0.9, 4.5
    slope = np.arctan2(rise, run)
    board = {"type": "box", "size": (np.hypot(rise, run) / 2, 1, 0.01), "euler": (0, -slope, 0)}
    builder.add_geom("terrain", {"type": "box", "size": (3, 3, 0.05), "pos": (-3, 0, -0.05)})
    builder.add_geom("inclined_ramp", board | {"pos": (run / 2, 0, rise / 2 - 0.01 / np.cos(slope))})
    builder.add_geom("terrain", {"type": "box", "size": (5, 3, 0.05), "pos": (run + 5, 0, rise - 0.05)})
    builder.add_surroundings(np.array([-6.0, -3.0]), np.array([run + 10, 3.0]))
    assert find_start(*compiled(builder)).position[2] == pytest.approx(0.0, abs=0.01)


def test_a_wished_start_stands_on_the_ground_that_is_there():
    world = compiled(corridor(6, ("ramp_17", 2, 90), ("deck_17", 3, 0), ("deck_17", 4, 0)))
    assert start_at(*world, 4.2, 0.0, 90.0).position == (4.2, 0.0, pytest.approx(0.17))
    assert start_at(*world, 0.0, 0.0, 90.0).yaw == pytest.approx(np.pi / 2)
    table = compiled(corridor(4, ("elevated_floor_120", 2, 0)))
    assert start_at(*table, 2.4, 0.0, 0.0).position[2] == 0


def test_a_requested_start_may_be_where_only_a_narrower_robot_than_the_pioneer_fits():
    assert start_at(*compiled(corridor(3)), 0.0, 0.32, 0.0).position == (0.0, 0.32, 0.0)


@pytest.mark.parametrize(
    ("xy", "said"),
    [
        ((np.nan, 0.0), "--start nan 0 0: .* finite"),
        ((0.0, np.inf), "--start 0 inf 0: .* finite"),
        ((0.0, 0.6), r"cannot stand at the start \(0, 0\.6\) m; .*--start"),
        ((50.0, 0.0), r"cannot stand at the start \(50, 0\) m; .*--start"),
    ],
)
def test_a_wish_that_cannot_be_is_refused(xy, said):
    with pytest.raises(InputError, match=said):
        start_at(*compiled(corridor(3)), *xy, 0.0)


def test_an_arena_takes_a_start():
    x, y = load_arena("nist_6x4").T_world_start[:2, 3]
    T = load_arena("nist_6x4", (x, y, 30.0)).T_world_start
    np.testing.assert_allclose(T[:2, 3], (x, y))
    assert yaw_of(T) == pytest.approx(np.radians(30))


def test_floors_come_largest_first_and_small_patches_not_at_all():
    floors = [(0.5, 0.0), (1.0, 3.0), (0.1, 5.0), (0.75, 7.0)]
    geoms = "".join(f'<geom type="box" size="{h} {h} 0.1" pos="{x} 0 0" user="2"/>' for h, x in floors)
    model = mujoco.MjModel.from_xml_string(f'<mujoco><size nuser_geom="1"/><worldbody>{geoms}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    sizes = [np.isfinite(g.height).sum() * CELL**2 for g in Survey(model, data, None).grounds(Label.TERRAIN, 0.25)]
    np.testing.assert_allclose(sizes, [4.0, 2.25, 1.0], rtol=0.1)


def test_a_start_without_a_position_is_the_origin(tmp_path):
    path = tmp_path / "arena.xml"
    path.write_text('<mujoco><worldbody><site name="start"/><geom type="plane" size="3 3 1"/></worldbody></mujoco>')
    np.testing.assert_array_equal(load_arena(str(path)).T_world_start, np.eye(4))


@pytest.mark.parametrize("turn", ['euler="0 0 90"', 'axisangle="0 0 1 90"', 'xyaxes="0 1 0 -1 0 0"', 'zaxis="0 0 1"'])
def test_the_start_may_turn_in_any_way_and_lie_in_a_body(tmp_path, turn):
    path = tmp_path / "arena.xml"
    body = f'<body pos="1 0.5 0"><site name="start" pos="0.5 0 0" {turn}/></body>'
    path.write_text(f'<mujoco><worldbody>{body}<geom type="plane" size="3 3 1" user="2"/></worldbody></mujoco>')
    yaw = 0.0 if "zaxis" in turn else np.pi / 2
    np.testing.assert_allclose(load_arena(str(path)).T_world_start, from_yaw(1.5, 0.5, 0, yaw), atol=1e-9)
    wished = load_arena(str(path), (-1.0, 0.0, 45.0)).T_world_start
    np.testing.assert_allclose(wished, from_yaw(-1, 0, 0, np.pi / 4), atol=1e-3)


FLAT = '<mujoco><worldbody>{}<geom type="plane" size="3 3 1" user="2"/>{}</worldbody></mujoco>'
STEP = '<geom type="box" pos="1 0 0.2" size="1 1 0.2" user="2"/>'


@pytest.mark.parametrize(
    ("site", "more", "expected", "said"),
    [
        ('pos="0 0 0.03"', "", from_yaw(0, 0, 0, 0), "0.03 m above the ground"),
        ('pos="0 0 -0.1"', "", from_yaw(0, 0, 0, 0), "0.10 m below the ground"),
        ('pos="1 0 0.5" euler="0 0 90"', STEP, from_yaw(1, 0, 0.4, np.pi / 2), "0.10 m above the ground"),
        ('pos="1 0 0" euler="0 30 0"', "", from_yaw(1, 0, 0, 0), "tilted by 30°"),
        ('pos="1 0 1.5" euler="0 20 90"', "", from_yaw(1, 0, 0, np.pi / 2), "1.50 m above the ground and tilted"),
        ('pos="0 0 0.001"', "", from_yaw(0, 0, 0.001, 0), ""),
    ],
)
def test_a_marked_start_is_upright_on_the_ground(site, more, expected, said, tmp_path, caplog):
    path = tmp_path / "arena.xml"
    path.write_text(FLAT.format(f'<site name="start" {site}/>', more))
    np.testing.assert_allclose(load_arena(str(path)).T_world_start, expected, atol=1e-6)
    assert [said in line for line in caplog.messages] == [True] * bool(said)


def test_a_start_without_ground_is_refused(tmp_path):
    path = tmp_path / "arena.xml"
    path.write_text(f'<mujoco><worldbody><site name="start" pos="5 0 0"/>{STEP}</worldbody></mujoco>')
    with pytest.raises(InputError, match=r"arena.xml: there is no free ground at \(5, 0\) m"):
        load_arena(str(path))
