"""Worlds as strangers have them that hold too much, too little or what may harm: one line, and the rest."""

import logging
import time

import numpy as np
import pytest
import trimesh

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.arenas.sdf.build import build_sdf
from sarsim.ground_truth.true_surface import MAX_AREA
from tests.sarsim.arenas.sdf.worlds import PLANE, Compiled, box, include, mesh, model, write

MM = 1e-3
DOWN = (0, 0, -1)


def lines_of(path, caplog):
    """The arena of a world, and what was said about it."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        arena = Compiled(path)
    assert all("\n" not in line and str(path) in line for line in caplog.messages)
    return arena, caplog.messages


def test_a_world_without_the_mesh_that_collides_is_as_it_is_seen(tmp_path, caplog):
    both = mesh("gone.dae") + box(1, 1, 1, "0 0 0.5 0 0 0", "visual")
    arena, (line,) = lines_of(write(tmp_path, PLANE, model("m", both)), caplog)
    assert arena.ray(0, 0, 5, along=DOWN) == pytest.approx(4, abs=MM) and "gone.dae" in line


def test_many_missing_models_are_one_short_line(tmp_path, caplog):
    gone = [include(f"model://gone_{n}") for n in range(200)]
    arena, (line,) = lines_of(write(tmp_path, PLANE, *gone, model("m", box(1, 1, 1))), caplog)
    assert arena.model.ngeom == 2 and "200" in line and len(line) < 10_000


def test_a_large_world_is_built_around_its_origin(tmp_path, caplog):
    """A world in feet, for one: what lies within is exact, and what lies across the edge is cut there."""
    places = [(x, y) for x in range(-150, 151, 30) for y in (0, 60)]
    blocks = [model(f"b{x}_{y}", box(10, 10, 6), pose=f"{x} {y} 3 0 0 0.2") for x, y in places]
    floor = model("road", box(400, 300, 0.2, "0 0 -0.1 0 0 0"))
    arena, (line,) = lines_of(write(tmp_path, floor, *blocks), caplog)
    assert "400 × 300" in line
    assert arena.ray(0, 0, 9, along=DOWN) == pytest.approx(3, abs=MM)
    for x, y in ((15, 0), (36, -36)):
        assert arena.ray(x, y, 9, along=DOWN) == pytest.approx(9, abs=MM)
    assert arena.ray(45, 0, 9, along=DOWN) == arena.ray(0, 60, 9, along=DOWN) == -1
    assert np.abs(load_arena(str(tmp_path / "a.world")).T_world_start[:2, 3]).max() < 40


def test_of_a_large_world_that_is_empty_about_its_origin_what_is_nearest_is_built(tmp_path, caplog):
    corners = [model(f"m{x}{y}", box(1, 1, 1), pose=f"{x} {y} 0.5 0 0 0") for x in (-99, 50) for y in (-99, 50)]
    arena, (line,) = lines_of(write(tmp_path, PLANE, *corners), caplog)
    assert arena.ray(50, 50, 5, along=DOWN) == pytest.approx(4, abs=MM) and f"{MAX_AREA:g}" not in line


def test_a_mesh_across_the_edge_of_what_is_built_keeps_its_walls(tmp_path):
    hall = trimesh.util.concatenate(
        [trimesh.creation.box((300, 0.2, 3)).apply_translation((0, y, 1.5)) for y in (-30, 30)]
        + [trimesh.creation.box((300, 60, 0.2)).apply_translation((0, 0, -0.1))]
    )
    hall.export(tmp_path / "hall.stl")
    arena = Compiled(write(tmp_path, model("hall", mesh("hall.stl"))))
    assert arena.ray(0, 0, 1, along=(0, 1, 0)) == pytest.approx(29.9, abs=MM)
    assert arena.ray(0, 0, 1, along=DOWN) == pytest.approx(1, abs=MM)
    assert np.ptp(arena.data.geom_xpos[:, 0]) < 100


def test_too_many_triangles_are_said_in_bounded_time(tmp_path, caplog):
    side = 1_001
    y, x = np.mgrid[:side, :side]
    first = (y[:-1, :-1] * side + x[:-1, :-1]).ravel()
    halves = [(first, first + 1, first + side), (first + 1, first + side + 1, first + side)]
    faces = np.concatenate([np.stack(half, axis=1) for half in halves])
    vertices = np.column_stack([x.ravel() / 50, y.ravel() / 50, np.sin(x + y).ravel() / 99])
    trimesh.Trimesh(vertices, faces[:1_900_000], process=False).export(tmp_path / "huge.stl")
    before = time.process_time()
    _, (line,) = lines_of(write(tmp_path, PLANE, model("m", box(1, 1, 1)), model("huge", mesh("huge.stl"))), caplog)
    assert "huge.stl" in line and "1900000" in line
    assert time.process_time() - before < 60


def test_what_would_move_or_shine_is_counted(tmp_path, caplog):
    more = "<plugin name='p' filename='libmove.so'/><actor name='a'><pose>0 0 0 0 0 0</pose></actor><light name='l'/>"
    saved = "<state world_name='w'><light name='l'><pose>0 0 0 0 0 0</pose></light></state>"
    _, (line,) = lines_of(write(tmp_path, PLANE, model("m", box(1, 1, 1)), more, saved), caplog)
    assert all(f"1 {kind}" in line for kind in ("plugin", "actor", "light")) and "2" not in line.partition(": ")[2]


def test_an_include_of_itself_stops_no_world(tmp_path, caplog):
    (tmp_path / "loop").mkdir()
    text = f"<sdf>{model('loop', box(1, 1, 1), inside=include('model://loop'))}</sdf>"
    (tmp_path / "loop" / "model.sdf").write_text(text)
    arena, (line,) = lines_of(write(tmp_path, PLANE, include("model://loop")), caplog)
    assert arena.model.ngeom == 2 and "itself" in line


@pytest.mark.parametrize(
    "text",
    [
        "<sdf version='1.6'><world name='w'/></sdf>",
        "<sdf version='1.6'/>",
        "<gazebo version='1.0'><world name='w'><model name='m'><link name='l'><collision name='c'><geometry>"
        "<box size='1 1 1'/></geometry></collision></link></model></world></gazebo>",
        "<robot name='r'/>",
        "",
    ],
)
def test_a_file_without_a_world_to_drive_in_is_refused_in_a_line(tmp_path, text):
    path = tmp_path / "a.world"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        build_sdf(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_numbers_behind_a_pose_and_a_plane_beyond_all_bounds_do_no_harm(tmp_path):
    """As Gazebo reads them: six numbers count, and a plane ends nowhere."""
    plane = "<collision name='c'><geometry><plane><size>1e6 1e6</size></plane></geometry></collision>"
    arena = Compiled(write(tmp_path, model("g", plane), model("m", box(1, 1, 1), pose="1 0 0.5 0 0 0 7 8")))
    assert arena.ray(1, 0, 5, along=DOWN) == pytest.approx(4, abs=MM)


def plane(x, y, more="", tag="collision"):
    """A link's shape of a plane of x × y m."""
    return f"<{tag} name='p'><geometry><plane><size>{x} {y}</size>{more}</plane></geometry></{tag}>"


def test_a_world_of_a_plane_alone_is_a_floor_of_its_size(tmp_path):
    arena = Compiled(write(tmp_path, model("ground", plane(30, 20), pose="5 0 0 0 0 0")))
    for x, y in ((19, 9), (-9, -9)):
        assert arena.ray(x, y, 5, along=DOWN) == pytest.approx(5, abs=MM)
    large = write(tmp_path, model("ground", plane(5000, 5000)), include("model://gone"), name="b.world")
    (ground,) = Compiled(large).model.geom_size
    assert 60**2 < 4 * np.prod(ground[:2]) <= MAX_AREA


def test_a_plane_that_stands_upright_far_away_stops_no_world(tmp_path, caplog):
    """As the rim of a sea does; as near, it is a plate of its size."""
    rim = [model(f"r{x}", plane(500, 7), pose=f"{x} 0 0 1.5708 0 1.5708") for x in (-250, 250)]
    sign = model("sign", plane(4, 2), pose="3 0 1 1.5707963 0 1.5707963")
    arena, (line,) = lines_of(write(tmp_path, PLANE, *rim, sign, model("m", box(1, 1, 1))), caplog)
    assert "500" in line
    assert arena.ray(0, 1.5, 1.5, along=(1, 0, 0)) == pytest.approx(3, abs=0.01 + MM)
    assert arena.ray(0, 2.5, 1.5, along=(1, 0, 0)) == -1


def test_what_is_wholly_transparent_is_not_there(tmp_path):
    water = plane(3e5, 3e5, tag="visual").replace("</geometry>", "</geometry><transparency>1.0</transparency>")
    arena = Compiled(write(tmp_path, model("water", water), model("bottom", plane(9, 9), pose="0 0 -99 0 0 0")))
    assert arena.ray(0, 0, 5, along=DOWN) == pytest.approx(104, abs=MM)


def test_the_league_names_its_worlds_like_models(tmp_path):
    path = write(tmp_path, PLANE, model("m", box(1, 1, 1)), name="RoboCup.model")
    assert load_arena(str(path)).mjcf_model.find_all("geom")
