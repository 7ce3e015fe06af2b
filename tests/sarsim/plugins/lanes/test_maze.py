"""The search-and-map maze has the guide's numbers, and a robot that climbs no diagonal reaches every cell."""

import mujoco
import numpy as np
import pytest

from sarsim.arenas.things.thing import things_of, things_of_kind
from sarsim.ground_truth.true_surface import Survey
from sarsim.plugins.lanes.maze import MazeConfig, MazePlan, build_maze
from sarsim.plugins.lanes.plugin import lane_arena

CELL, HALF = 1.22, 1.22 * np.array([9, 5]) / 2


@pytest.fixture(scope="module")
def world():
    """The model and the data of the maze."""
    arena = lane_arena("maze")
    model = mujoco.MjModel.from_xml_string(arena.mjcf_model.to_xml_string(), arena.mjcf_model.get_assets())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def named(world, start):
    model, data = world
    geoms = [g for g in range(model.ngeom) if model.geom(g).name.startswith(start)]
    return model.geom_size[geoms], data.geom_xpos[geoms]


def test_panels_and_entrances(world):
    sizes, places = named(world, "wall")
    assert len(sizes) == 36 + 3
    assert sorted(set(map(tuple, np.sort(sizes, axis=1).round(6)))) == [(0.005, 0.61, 1.1)]
    assert np.abs(places[:, :2]).max(axis=0) == pytest.approx(HALF)
    assert sum(panel.is_entrance for panel in MazePlan().panels()) == 3


def test_ten_tubes_are_cut_by_panels(world):
    sizes, places = named(world, "tube_")
    assert len(sizes) == 10 and (sizes[:, 0] == 0.15).all()
    assert sorted((places[:, 2] + sizes[:, 1]).round(6)) == [1.0] * 5 + [2.0] * 5
    panels = named(world, "wall")[1]
    distance = np.linalg.norm(places[:, None, :2] - panels[None, :, :2], axis=2).min(axis=1)
    assert distance == pytest.approx(np.zeros(10), abs=1e-6)


def test_diagonals_and_crosses_of_lumber(world):
    sizes, places = named(world, "clutter")
    pairs, singles = sizes[:, 1] == 0.038, sizes[:, 1] == 0.019
    assert (pairs.sum(), singles.sum()) == (19, 4)
    assert 2 * sizes[singles, 0] == pytest.approx(1.3)
    assert places[:, 2] == pytest.approx(0.0445)


def test_every_cell_can_be_reached_without_climbing(world):
    model, data = world
    surface = Survey(model, data).surface_from(data.site("start").xpos)
    centres = surface.grid.centre_of(np.argwhere(surface.drivable))
    cells = {tuple(cell) for cell in np.floor((centres + HALF) / CELL).astype(int)}
    assert cells == {(i, j) for i in range(9) for j in range(5)}


def test_codes_and_signs_hang_on_the_inner_faces(world):
    things = things_of(*world)
    codes, signs = things_of_kind(things, "qr_code"), things_of_kind(things, "hazmat_sign")
    assert len({code.text for code in codes}) == len(codes) == len(signs) == 10
    for thing in (*codes, *signs):
        assert (np.abs(thing.centre[:2]) < HALF).all() and thing.normal[:2] @ thing.centre[:2] < 0


def test_codes_and_signs_alternate_until_there_are_enough():
    assert (
        build_maze(MazeConfig(thing_count=3)).next_thing_number
        == build_maze(MazeConfig(thing_count=0)).next_thing_number + 3
    )


def test_a_dark_tarp_covers_it(world):
    model, data = world
    geom = np.full(1, -1, np.int32)
    up = mujoco.mj_ray(
        model, data, data.site("start").xpos + np.array([0, 0, 0.1]), np.array([0, 0, 1.0]), None, 1, -1, geom, None
    )
    assert up == pytest.approx(2.1)
