"""The laboratory floor is what its plan says, and a P3-AT can drive to all of it."""

import mujoco
import numpy as np
import pytest
from scipy import ndimage

from pipeline.labels import Label
from pipeline.robot import Velocity
from sarsim.arenas.load import load_arena
from sarsim.arenas.promises import broken_promises
from sarsim.assets import asset
from sarsim.camera import geom_labels
from sarsim.scoring.true_surface import CELL, true_surface
from sarsim.scripts.esogu import building, plan
from sarsim.scripts.make_esogu import TARGET, laboratory_floor
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from sarsim.victims import victims_of

ROOMS = (*plan.SOUTH_ROOMS, *plan.NORTH_ROOMS)
WALLS = ("outer", "corridor_south", "corridor_north", "south", "north", "column", "ceiling", "floor")
TOUCH = 0.002
"""m that things may reach into each other where they touch."""


@pytest.fixture(scope="module")
def world():
    model = mujoco.MjModel.from_xml_path(str(asset("arenas", "esogu_52x15.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.fixture(scope="module")
def surface(world):
    model, data = world
    return true_surface(model, data, None, data.site("start").xpos)


def thing_of(model, geom):
    """What a geom is a part of: a piece of furniture, a victim with what covers it, the building, the course."""
    body = model.body(model.geom_bodyid[geom]).name
    if body != "world":
        return "victim " + body.split("_")[1]
    name = model.geom(geom).name.rpartition("_")[0]
    is_course = name.startswith(("ramp", "deck", "small_wall", "wall_holes", "barrel"))
    return "building" if name in WALLS or not name else "course" if is_course else name


def test_the_file_is_what_the_plan_says():
    assert laboratory_floor().to_xml() == TARGET.read_text()


def test_it_measures_52_by_15_m_under_a_ceiling_of_2_7_m(world, surface):
    model, data = world
    reach = np.abs(data.geom_xpos) + np.einsum(
        "nij,nj->ni", np.abs(data.geom_xmat.reshape(-1, 3, 3)), model.geom_size
    )
    np.testing.assert_allclose(reach[:, :2].max(axis=0), [26, 7.5])
    labels, geom = geom_labels(model), np.zeros(1, np.int32)
    places = surface.grid.centre_of(np.argwhere(surface.drivable))[::97]
    for x, y in places[np.abs(places[:, 1:] - [building.SOUTH_WALL, building.NORTH_WALL]).min(axis=1) > 0.2]:
        up = mujoco.mj_ray(model, data, np.array([x, y, 2.5]), np.array([0, 0, 1.0]), None, 1, -1, geom, None)
        assert labels[geom[0]] == Label.CEILING
        assert 2.66 < 2.5 + up < 2.71


def test_everything_stands_still_and_has_a_label(world):
    model, _ = world
    assert model.nv == 0
    assert (geom_labels(model) != Label.UNLABELLED).all()
    assert set(np.unique(geom_labels(model))) == {1, 2, 3, 4, 5, 6, 7}
    assert not model.light_castshadow.any()


def test_nothing_stands_in_something_else(world):
    model, data = world
    things = np.array([thing_of(model, g) for g in range(model.ngeom)])
    centre, R = data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3)
    middle = centre + np.einsum("nij,nj->ni", R, model.geom_aabb[:, :3])
    half = np.einsum("nij,nj->ni", np.abs(R), model.geom_aabb[:, 3:]) - TOUCH / 2
    bodies = np.flatnonzero(model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    inside = []
    for n, a in enumerate(bodies):
        others = bodies[n + 1 :]
        near = (np.abs(middle[others] - middle[a]) < half[others] + half[a]).all(axis=1)
        for b in others[near & (things[others] != things[a])]:
            if mujoco.mj_geomDistance(model, data, a, b, 0.0, None) < -TOUCH:
                inside.append((model.geom(a).name, model.geom(b).name))
    assert not inside


def test_it_keeps_what_random_arenas_promise():
    assert broken_promises(load_arena("esogu_52x15").mjcf_model.to_xml_string()) == []


def test_ten_victims(world):
    assert sorted(int(v.id) for v in victims_of(*world)) == list(range(1, 11))


def test_ways_of_almost_a_metre_lead_to_every_room(surface):
    """Where the robot's middle may be, with 0.1 m more on both sides."""
    wide = ndimage.distance_transform_edt(surface.drivable) * CELL > 0.1
    pieces, _ = ndimage.label(wide)
    start = pieces[tuple(surface.grid.cell_of(np.array(plan.START)))]
    x, y = surface.grid.centre_of(np.argwhere(pieces == start)).T
    for room in ROOMS:
        across = y < building.SOUTH_WALL if room in plan.SOUTH_ROOMS else y > building.NORTH_WALL
        inside = np.count_nonzero((x > room.west) & (x < room.east) & across) * CELL**2
        assert inside > 0.2 * (room.east - room.west) * 5, room.name
    assert surface.drivable.sum() * CELL**2 > 400


def test_a_robot_drives_over_the_deck_in_the_corridor():
    robot = SimulatedRobot(load_arena("esogu_52x15", start=(5.6, 0.0, 0.0)), SimulationConfig(), seed=0)
    highest, lean = 0.0, 0.0
    for _ in range(500):
        robot.drive(Velocity(0.3, 0.0))
        T = robot.trajectory[-1].T_world_base
        highest, lean = max(highest, T[2, 3]), max(lean, np.degrees(np.arccos(T[2, 2])))
    robot.close()
    assert T[0, 3] > 10.6
    assert abs(T[1, 3]) < 0.1
    assert highest == pytest.approx(0.17, abs=0.02)
    assert lean < 20
    assert robot.collisions.collisions == 0
