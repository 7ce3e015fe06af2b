"""SDF worlds as arenas: rays in MuJoCo against the numbers of the file."""

import logging
from math import cos, pi, radians, sqrt
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.arenas.sdf.build import build_sdf
from sarsim.ground_truth.true_surface import MAX_AREA, Survey
from tests.sarsim.arenas.sdf.worlds import PLANE, Compiled, box, mesh, model, write

MM = 1e-3
X, Y, DOWN = (1, 0, 0), (0, 1, 0), (0, 0, -1)


def test_simple_shapes_have_the_sizes_of_the_file(tmp_path):
    def shape(x, text):
        collision = f"<collision name='c'><geometry>{text}</geometry></collision>"
        return f"<link name='l{x}'><pose>{x} 0 1 0 0 0</pose>{collision}</link>"

    world = Compiled(
        write(
            tmp_path, PLANE, "<model name='m'>",
            shape(0, "<box><size>0.4 0.6 1.2</size></box>"),
            shape(2, "<cylinder><radius>0.3</radius><length>0.8</length></cylinder>"),
            shape(4, "<sphere><radius>0.25</radius></sphere>"),
            shape(6, "<capsule><radius>0.2</radius><length>0.5</length></capsule>"),
            shape(8, "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>"),
            shape(10, "<cone><radius>0.4</radius><length>0.8</length></cone>"),
            "</model>",
        )
    )  # fmt: skip
    for x, top, side in [(0, 0.6, 0.3), (2, 0.4, 0.3), (4, 0.25, 0.25), (6, 0.45, 0.2), (8, 0.3, 0.2)]:
        assert world.ray(x, 0, 5, along=DOWN) == pytest.approx(4 - top, abs=MM)
        assert world.ray(x, -3, 1, along=Y) == pytest.approx(3 - side, abs=MM)
    assert world.ray(10.2, 0, 5, along=DOWN) == pytest.approx(4, abs=MM)  # half way down a cone
    assert world.ray(1, 1, 5, along=DOWN) == pytest.approx(5, abs=MM)  # the ground


def test_a_plane_has_room_for_goals_before_what_stands_outermost(tmp_path, shared):
    for path in (write(tmp_path, PLANE, model("m", box(0.4, 0.4, 0.4))), shared / "barn" / "world_0.world"):
        world = Compiled(path)
        highest = world.model.geom_pos[1:, 1].max()
        assert world.ray(-2, highest + 3.5, 5, along=DOWN) == pytest.approx(5, abs=MM)


def test_nested_models_links_and_shapes_add_their_poses(tmp_path):
    inner = model("inner", box(0.2, 0.2, 0.2, "0.5 0 0 0 0 0"), pose=f"1 0 0 0 0 {pi / 2}")
    world = Compiled(write(tmp_path, PLANE, model("outer", pose=f"2 3 1 0 0 {pi / 2}", inside=inner)))
    # inner: 2 - 0, 3 + 1; turned by 180°; the box half a metre before it.
    assert world.ray(1.5, 4, 5, along=DOWN) == pytest.approx(3.9, abs=MM)
    assert world.ray(-3, 4, 1, along=X) == pytest.approx(4.4, abs=MM)


def test_poses_may_be_relative_to_links_frames_joints_and_models(tmp_path):
    world = Compiled(
        write(
            tmp_path,
            PLANE,
            "<frame name='corner'><pose>5 0 0 0 0 0</pose></frame>",
            "<model name='a'><pose relative_to='corner'>0 1 0 0 0 0</pose>"
            "<link name='base'><pose>0 0 1 0 0 0</pose></link>"
            "<joint name='hinge'><pose>0 0 1 0 0 0</pose><parent>world</parent><child>base</child></joint>"
            f"<link name='tip'><pose relative_to='hinge'>1 0 0 0 0 0</pose>{box(0.2, 0.2, 0.2)}</link>"
            "<frame name='handle' attached_to='tip'><pose>0 2 0 0 0 0</pose></frame></model>",
            f"<model name='b'><pose relative_to='a::handle'>0 0 -1 0 0 0</pose><link name='l'>{box(0.4, 0.4, 0.4)}"
            "</link></model>",
        )
    )
    assert world.ray(6, 1, 5, along=DOWN) == pytest.approx(2.9, abs=MM)
    assert world.ray(6, 3, 5, along=DOWN) == pytest.approx(3.8, abs=MM)


def test_an_include_takes_the_newest_file_and_may_place_a_frame_of_it(tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", f"/none:{elsewhere}")
    folder = elsewhere / "crate"
    folder.mkdir(parents=True)
    (folder / "model.config").write_text(
        "<model><name>crate</name><sdf version='1.10'>new.sdf</sdf><sdf version='1.9'>old.sdf</sdf></model>"
    )
    frame = "<frame name='top'><pose>0 0 0.5 0 0 0</pose></frame>"
    (folder / "new.sdf").write_text(
        f"<sdf version='1.10'>{model('crate', box(1, 1, 1), pose='9 9 9 0 0 0', inside=frame)}</sdf>"
    )
    world = write(
        tmp_path / "worlds", PLANE,
        "<include><uri>model://crate</uri><name>first</name><pose>0 0 0.5 0 0 0</pose></include>",
        "<include placement_frame='top'><uri>https://fuel.gazebosim.org/1.0/openrobotics/models/crate/3</uri>"
        "<name>second</name><pose relative_to='first'>3 0 1 0 0 0</pose></include>",
    )  # fmt: skip
    arena = Compiled(world)
    assert arena.ray(0, 0, 5, along=DOWN) == pytest.approx(4, abs=MM)
    assert arena.ray(3, 0, 5, along=DOWN) == pytest.approx(3.5, abs=MM)


def test_models_and_links_of_one_name_keep_their_poses(tmp_path):
    inside = model("l0", box(0.2, 0.2, 0.2), pose="1 0 1 0 0 0") + model("l0", box(0.2, 0.2, 0.2), pose="2 0 1 0 0 0")
    arena = Compiled(write(tmp_path, PLANE, model("m", box(0.4, 0.4, 0.4, "0 0 1 0 0 0"), inside=inside)))
    tops = [arena.ray(x, 0, 5, along=DOWN) for x in (0, 1, 2)]
    np.testing.assert_allclose(tops, [3.8, 3.9, 3.9], atol=MM)


def test_the_state_of_a_world_moves_its_models(tmp_path):
    state = "<state world_name='w'><model name='m'><pose>4 0 1 0 0 0</pose></model></state>"
    arena = Compiled(write(tmp_path, PLANE, model("m", box(1, 1, 1)), state))
    assert arena.ray(4, 0, 5, along=DOWN) == pytest.approx(3.5, abs=MM)


def test_a_link_is_as_it_collides_in_the_colour_of_what_is_seen(tmp_path):
    red = "<material><diffuse>1 0 0 1</diffuse></material></visual>"
    link = box(1, 1, 1) + box(2, 2, 2, tag="visual").replace("</visual>", red)
    arena = Compiled(write(tmp_path, PLANE, model("m", link), model("n", box(1, 1, 1, "5 0 0 0 0 0", "visual"))))
    assert arena.ray(0, -5, 0.2, along=Y) == pytest.approx(4.5, abs=MM)
    material = arena.model.geom_matid[1]
    np.testing.assert_allclose(arena.model.mat_rgba[material], [1, 0, 0, 1])
    assert arena.ray(5, -5, 0.2, along=Y) == pytest.approx(4.5, abs=MM)  # seen only, so it is as seen


def test_labels_follow_from_shape_and_place(tmp_path):
    slope = radians(15)
    arena = Compiled(
        write(
            tmp_path, PLANE,
            model(
                "m", box(3, 0.1, 1.2, "0 3 0.6 0 0 0"), box(1.2, 1.2, 0.2, "0 0 0.1 0 0 0"),
                box(1.2, 1.2, 0.02, f"3 0 0.2 0 {slope} 0"), box(0.4, 0.4, 0.4, "6 0 0.2 0 0 0"),
                box(4, 4, 0.1, "0 0 2.5 0 0 0"), box(2, 2, 0.05, "9 0 0.02 0 0 0"),
                box(1.5, 0.8, 0.04, "0 6 0.75 0 0 0"), box(1.2, 1.2, 0.02, f"3 6 0.5 0 {radians(30)} 0"),
                box(0.4, 0.4, 2.4, "6 6 1.2 0 0 0"),
            ),
        )
    )  # fmt: skip
    assert arena.labels == [
        *("terrain", "wall", "straight_ramp", "inclined_ramp", "clutter", "ceiling", "terrain"),
        *("clutter", "clutter", "wall"),
    ]
    top = 0.2 + 0.01 / cos(slope)  # of the inclined board above its middle
    assert arena.ray(3, 0, 2, along=DOWN) == pytest.approx(2 - top, abs=MM)


def test_the_floor_of_a_higher_level_is_terrain(tmp_path):
    levels = model("m", box(10, 10, 0.1, "0 0 0.05 0 0 0"), box(8, 10, 0.1, "9 0 1.05 0 0 0"))
    assert Compiled(write(tmp_path, levels)).labels == ["terrain", "terrain"]


def test_a_model_alone_gets_a_floor(tmp_path):
    path = tmp_path / "model.sdf"
    path.write_text(f"<sdf version='1.6'>{model('walls', box(4, 0.1, 1, '0 1 0.5 0 0 0'))}</sdf>")
    arena = Compiled(path)
    assert arena.labels == ["terrain", "wall"]
    assert arena.ray(0, 0, 3, along=DOWN) == pytest.approx(3, abs=MM)


def test_a_plane_faces_along_its_normal(tmp_path):
    wall = (
        "<collision name='c'><geometry><plane><normal>1 0 0</normal><size>8 8</size></plane></geometry></collision>"
    )
    arena = Compiled(write(tmp_path, PLANE, model("m", wall, pose="-2 0 0 0 0 0"), model("n", box(1, 1, 1))))
    assert arena.ray(-1, 1, 1, along=(-1, 0, 0)) == pytest.approx(1, abs=MM)


def test_polylines_are_extruded_with_holes(tmp_path):
    def outline(half, height):
        points = [(-half, -half), (half, -half), (half, half), (-half, half)]
        return (
            f"<polyline>{''.join(f'<point>{x} {y}</point>' for x, y in points)}<height>{height}</height></polyline>"
        )

    shape = f"<collision name='c'><geometry>{outline(2, 0.9)}{outline(1, 0.9)}</geometry></collision>"
    arena = Compiled(write(tmp_path, PLANE, model("m", shape, pose=f"0 0 0 0 0 {pi / 4}")))
    assert arena.ray(0, 0, 0.5, along=X) == pytest.approx(sqrt(2), abs=MM)
    assert arena.ray(9, 0, 0.5, along=(-1, 0, 0)) == pytest.approx(9 - 2 * sqrt(2), abs=MM)
    assert arena.ray(1.5 * sqrt(2), 0, 5, along=DOWN) == pytest.approx(4.1, abs=MM)


def test_what_is_left_out_is_said_once(tmp_path, caplog):
    extra = "<plugin name='p' filename='a.so'/><plugin name='q' filename='b.so'/><actor name='walker'/>"
    sensor = box(1, 1, 1, "0 0 0.5 0 0 0") + "<sensor name='s' type='camera'/>"
    path = write(tmp_path, PLANE, model("m", sensor), extra)
    with caplog.at_level(logging.WARNING):
        build_sdf(path)
    assert [record.getMessage() for record in caplog.records] == [
        f"{path}: loaded without unsupported elements: 1 sensor, 2 plugins, 1 actor"
    ]


def test_the_robot_starts_on_free_ground(tmp_path):
    walls = [box(4, 0.1, 1, f"0 {y} 0.5 0 0 0") for y in (-2, 2)] + [
        box(0.1, 4, 1, f"{x} 0 0.5 0 0 0") for x in (-2, 2)
    ]
    path = write(tmp_path, PLANE, model("room", *walls, pose="1 0 0 0 0 0"))
    x, y, z = load_arena(str(path)).T_world_start[:3, 3]
    assert -1 < x < 3 and -2 < y < 2 and z == 0
    np.testing.assert_allclose(load_arena(str(path), (1.5, 0.5, 90)).T_world_start[:3, 3], [1.5, 0.5, 0])


def test_too_many_shapes_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("sarsim.arenas.sdf.build.MAX_GEOMS", 5)
    with pytest.raises(InputError, match=r"a\.world: .*shapes.*5"):
        build_sdf(write(tmp_path, *[model(f"m{n}", box(1, 1, 1)) for n in range(6)]))
    with pytest.raises(InputError, match=r"a\.world: .*shape"):
        build_sdf(write(tmp_path, "<light name='sun'/>"))


def include(uri):
    return f"<include><uri>model://{uri}</uri></include>"


LOST = {
    "far": model("lost", box(1, 1, 1), pose="1 1 343582.7 0 0 0"),
    "not a number": model("lost", box(1, 1, 1), pose="nan nan nan 0 0 0"),
    "infinite": model("lost", box(1, 1, 1), pose="0 inf 0 0 0 0"),
    "far link": "<model name='lost'><link name='lost'><pose>1e9 0 0 0 0 0</pose>" + box(1, 1, 1) + "</link></model>",
    "far sum": model("lost", inside=model("m", box(1, 1, 1), pose="7000 0 0 0 0 0"), pose="7000 0 0 0 0 0"),
    "far aside": model("lost", box(1, 1, 1), pose="-3000 400 0 0 0 0"),
    "state": model("lost", box(1, 1, 1))
    + "<state world_name='w'><model name='lost'><pose>0 0 nan 0 0 0</pose></model></state>",
    "size": model("lost", box("nan", 1, 1)),
    "missing model": include("lost"),
    "missing mesh": model("lost", mesh("model://lost/a.dae")),
    "unknown shape": model("lost", "<collision name='c'><geometry><lost/></geometry></collision>"),
    "frame": model("lost", "<collision name='c'><pose relative_to='lost'/><geometry><box/></geometry></collision>"),
}


@pytest.mark.parametrize("kind", LOST)
def test_one_thing_that_is_lost_stops_no_world(kind, tmp_path, caplog):
    walls = [model(f"wall{n}", box(1, 1, 1), pose=f"{n} 0 0.5 0 0 0") for n in range(10)]
    arena = Compiled(write(tmp_path, PLANE, *walls, LOST[kind]))
    assert arena.model.ngeom == 11
    (line,) = caplog.messages
    assert "a.world: loaded without 1 item: " in line and ("lost" in line or "-3000" in line)


def test_all_that_is_missing_is_named_once_in_one_line(tmp_path, caplog):
    Compiled(write(tmp_path, PLANE, include("pump"), include("pump"), include("tank"), model("m", mesh("b.stl"))))
    (line,) = caplog.messages
    assert [line.count(name) for name in ("pump", "tank", "b.stl")] == [1, 1, 1]


def test_a_world_of_which_all_models_are_missing_is_an_empty_floor(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        floor = Compiled(write(tmp_path, include("pump"), include("tank")))
    (line,) = caplog.messages
    assert "pump" in line and "tank" in line
    assert floor.ray(1, 1, 5, along=DOWN) == pytest.approx(5, abs=MM)


def test_a_world_in_which_there_never_was_anything_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"a\.world"):
        build_sdf(write(tmp_path))


def test_what_may_harm_still_refuses_the_whole(tmp_path):
    (tmp_path / "m").mkdir()
    (tmp_path / "m" / "model.sdf").write_text('<!DOCTYPE a [<!ENTITY b "c">]><sdf>&b;</sdf>')
    for uri in ("m", "../../secret"):
        with pytest.raises(InputError, match="refused"):
            build_sdf(write(tmp_path, PLANE, model("w", box(1, 1, 1)), include(uri)))


def test_a_raised_model_alone_stands_on_a_floor(tmp_path):
    table = model("table", box(4, 4, 0.1, "0 0 0.7 0 0 0"), box(0.1, 0.1, 0.65, "0 0 0.325 0 0 0"))
    (tmp_path / "model.sdf").write_text(f"<sdf version='1.6'>{table}</sdf>")
    assert load_arena(str(tmp_path / "model.sdf")).T_world_start[2, 3] == 0


def test_the_underside_of_a_slab_is_no_ground(tmp_path):
    shell = trimesh.creation.box((6, 6, 0.15))
    shell.update_faces(np.arange(12) != 3)  # open, so that each of its sides is a plate
    shell.export(tmp_path / "slab.stl")
    (tmp_path / "model.sdf").write_text(f"<sdf version='1.6'>{model('s', mesh('slab.stl'))}</sdf>")
    assert load_arena(str(tmp_path / "model.sdf")).T_world_start[2, 3] == pytest.approx(0.075, abs=MM)


@pytest.mark.parametrize("seed", range(4))
def test_a_world_that_is_too_large_is_cut_so_that_it_fits(seed: int, tmp_path: Path) -> None:
    """Also where a round object lies across the edge, or rounding adds to the length of a wall."""
    rng = np.random.default_rng(seed)
    cylinder = "<geometry><cylinder><radius>3</radius><length>2</length></cylinder></geometry>"
    shapes = [box(*rng.uniform(0.1, 60, 2), 1) for _ in range(12)] + [
        f"<collision name='c'>{cylinder}</collision>"
    ] * 60
    poses = [f"{x} {y} 0 0 0 {yaw}" for x, y, yaw in rng.uniform(-80, 80, (len(shapes), 3))]
    world = Compiled(
        write(
            tmp_path, PLANE, *(model(f"m{n}", s, pose=p) for n, (s, p) in enumerate(zip(shapes, poses, strict=True)))
        )
    )
    bodies = Survey(world.model, world.data).bodies  # refuses what is too large
    assert np.prod(np.ptp(np.stack([bodies.low, bodies.high]), axis=(0, 1))[:2]) <= MAX_AREA
