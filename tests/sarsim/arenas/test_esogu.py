"""The laboratory floor is solid, stands still, and a P3-AT can drive to all of it."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest
import shapely

from pipeline.labels import Label
from pipeline.robot import Velocity
from sarsim.arenas.checks import failed_checks
from sarsim.arenas.load import load_arena
from sarsim.assets import asset
from sarsim.ground_truth.columns import convex_bodies
from sarsim.ground_truth.contacts import OBSTACLES
from sarsim.ground_truth.true_surface import CELL, Survey
from sarsim.robots.skid_steered import robot_model
from sarsim.sensors.camera import geom_labels
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from sarsim.victims.victims import victims_of

CORRIDOR = -0.66, 2.06
"""y of the centre lines of the corridor's walls, m."""
SOUTH_ROOMS = (-25.9, -16.04, -7.0, 3.12, 14.12, 25.9)
NORTH_ROOMS = (-25.9, -20.0, -16.0, -12.0, -3.0, 3.0, 7.0, 11.0, 17.0, 25.9)
"""x of the walls between the rooms on either side of the corridor, m."""
ROOMS = [
    *((west, -7.3, east, CORRIDOR[0]) for west, east in pairwise(SOUTH_ROOMS)),
    *((west, CORRIDOR[1], east, 7.3) for west, east in pairwise(NORTH_ROOMS)),
]
"""West, south, east and north wall of each room, m."""
WALLS = ("outer", "corridor_south", "corridor_north", "south", "north", "column", "ceiling", "floor")
RAMPS = (Label.INCLINED_RAMP, Label.STRAIGHT_RAMP)
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
    return Survey(model, data).surface_from(data.site("start").xpos)


def thing_of(model, geom):
    """The object that a geom belongs to: a piece of furniture, a victim with its cover, the building, the course."""
    body = model.body(model.geom_bodyid[geom]).name
    if body != "world":
        return "victim " + body.split("_")[1]
    name = model.geom(geom).name.rpartition("_")[0]
    is_course = name.startswith(("ramp", "deck", "small_wall", "wall_holes", "barrel"))
    return "building" if name in WALLS or not name else "course" if is_course else name


def test_it_measures_52_by_15_m_under_a_ceiling_of_2_7_m(world, surface):
    model, data = world
    reach = np.abs(data.geom_xpos) + np.einsum(
        "nij,nj->ni", np.abs(data.geom_xmat.reshape(-1, 3, 3)), model.geom_size
    )
    np.testing.assert_allclose(reach[:, :2].max(axis=0), [26, 7.5])
    labels, geom = geom_labels(model), np.zeros(1, np.int32)
    places = surface.grid.centre_of(np.argwhere(surface.drivable))[::97]
    for x, y in places[np.abs(places[:, 1:] - CORRIDOR).min(axis=1) > 0.2]:
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


def test_it_passes_the_checks_of_random_arenas():
    assert list(failed_checks(load_arena("esogu_52x15").mjcf_model.to_xml_string())) == []


def test_ten_victims(world):
    assert sorted(int(v.id) for v in victims_of(*world)) == list(range(1, 11))


def way_from_start(world, width, solid):
    """The area that the centre line of a lane of ``width`` m can reach from the start, around labels ``solid``."""
    model, data = world
    bodies = convex_bodies(model, data, None)
    low = (bodies.low[:, 2] < robot_model().headroom) & (bodies.high[:, 2] > 0) & np.isin(bodies.label, solid)
    outlines = [shapely.Polygon(bodies.corners[slice(*bodies.first_corner[n : n + 2])]) for n in np.flatnonzero(low)]
    free = shapely.box(-26, -7.5, 26, 7.5) - shapely.union_all(outlines).buffer(width / 2)
    start = shapely.Point(data.site("start").xpos[:2])
    return next(piece for piece in shapely.get_parts(free) if piece.covers(start))


@pytest.mark.parametrize("solid", [OBSTACLES, (*OBSTACLES, *RAMPS)], ids=["over ramps", "around ramps"])
def test_ways_of_99_cm_lead_into_every_room(world, surface, solid):
    way = way_from_start(world, 0.99, solid)
    for west, south, east, north in ROOMS:
        floor = shapely.box(west, south + 0.1, east, north - 0.1)
        assert way.intersection(floor).area > 0.2 * floor.area, (west, south)
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
