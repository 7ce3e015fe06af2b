"""Each lane loads, has the fabrication guide's size and slopes, and asks of a body what stands in it."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from sarsim.plugins.lanes.lanes import LANES
from sarsim.plugins.lanes.plugin import lane_arena
from sarsim.robots.model import robot_model

TAN, SIN, COS = (f(math.radians(15)) for f in (math.tan, math.sin, math.cos))
PIONEER = robot_model()
FLOORED = sorted(set(LANES) - {"avoid_holes"})
"""Lanes of four framed floors; the pallets between the holes lie in the hall."""
LONG = {"krails_15": 2 * (1.2 + 1.2 * COS), "centre": 2.4 + 2.4 * COS}
"""m, where floors of 1.2 m slope along the lane."""


def loaded(lane):
    """The model and the data of a lane."""
    model = mujoco.MjModel.from_xml_string(lane_arena(lane).to_xml())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def reach(world, start, ray):
    """m to what a ray meets; negative if that is nothing."""
    geom = np.full(1, -1, np.int32)
    return mujoco.mj_ray(*world, np.array(start, float), np.array(ray, float), None, 1, -1, geom, None)


def height(world, x, y):
    """m, of what lies uppermost."""
    return 4 - reach(world, (x, y, 4), (0, 0, -1))


def between(world, place, ray):
    """m of free way on both sides of a place."""
    return reach(world, place, ray) + reach(world, place, [-n for n in ray])


@pytest.mark.parametrize("lane", FLOORED)
def test_a_lane_is_2_4_m_wide_and_4_8_m_long_between_railings(lane):
    world = loaded(lane)
    if lane != "traverse":  # its railings lean with the floor
        # Just below the top bars; the tilted railings of other floors are farther away.
        for x, z in ((-1.8, 0.85),) if lane == "centre" else ((-1.8, 0.85), (1.8, 0.85)):
            assert between(world, (x, 0.0, z), (0, 1, 0)) == pytest.approx(2.4, abs=1e-6)
    model, data = world
    bars = [g for g in range(model.ngeom) if np.allclose(model.geom_size[g], [0.6, 0.019, 0.0445])]
    low, high = data.geom_xpos[bars].min(axis=0), data.geom_xpos[bars].max(axis=0)
    if lane != "centre":
        assert high[0] - low[0] == pytest.approx(LONG.get(lane, 4.8) + 0.038, abs=1e-6)


@pytest.mark.parametrize("lane", FLOORED)
def test_railings_have_three_bars_whose_tops_are_at_30_60_and_90_cm(lane):
    model, data = loaded(lane)
    bars = [g for g in range(model.ngeom) if np.allclose(model.geom_size[g], [0.6, 0.019, 0.0445])]
    assert len(bars) == 3 * (15 if lane in ("alleys", "centre") else 12)  # of 1.2 m; three stand in the alleys
    if lane not in ("centre", "krails_15", "traverse"):
        tops = data.geom_xpos[bars, 2] + 0.0445
        assert {round(float(top), 6) for top in tops} == {0.3, 0.6, 0.9}


@pytest.mark.parametrize("lane", sorted(set(FLOORED) - {"alleys", "centre"}))
def test_the_end_zones_are_moved_5_cm_to_either_side(lane):
    model, data = loaded(lane)
    floors = [g for g in range(model.ngeom) if np.allclose(model.geom_size[g], [0.6, 1.2, 0.0555])]
    across = COS if lane == "traverse" else 1.0
    places = sorted(map(tuple, data.geom_xpos[floors]))
    assert [y for _, y, _ in places if abs(y) > 0.03] == pytest.approx([0.05 * across, -0.05 * across], abs=0.02)


@pytest.mark.parametrize("lane", LANES)
def test_the_robot_starts_on_the_ground(lane):
    world = loaded(lane)
    x, y, z = world[1].site("start").xpos
    assert z == pytest.approx(height(world, x, y), abs=1e-3)
    assert x < -1.2


@pytest.mark.parametrize(
    ("lane", "heights"),
    [
        ("crossing_ramps", {(-0.9, 0.6): 0.3 * TAN, (-0.61, 0.6): 0.59 * TAN, (-1.19, -0.6): 0.59 * TAN}),
        ("krails", {(-0.6, 0.6): 0.1, (0.6, -0.6): 0.1, (0.01, 0.0): 0.1, (-0.6, 0.0): 0.0, (1.8, 0.55): 0.1}),
        (
            "krails_15",
            {(-0.6 * COS, 0.0): 0.6 * SIN, (0.6 * COS, 0.0): 0.6 * SIN, (-0.6 * COS, -0.6): 0.6 * SIN + 0.1 / COS},
        ),
        ("stepfield", {(-0.1, 0.1): 0.3, (-0.1, 0.4): 0.15, (0.4, 0.1): 0.15, (-0.6, 0.0): 0.0}),
        ("pitch_roll", {(-1.795, 0.655): 0.0, (-1.795, -0.545): 0.15, (-0.595, -0.595): 0.0, (-0.595, 0.605): 0.15}),
        ("traverse", {(0.0, -0.2): 1.2 * SIN - 0.2 * TAN, (0.0, 0.05): 1.2 * SIN + 0.05 * TAN}),
        ("centre", {(-0.6, 0.0): 0.0, (0.6, 0.9): 0.6 * TAN, (1.8, 0.0): 1.8 * TAN}),
        ("hurdles", {(-1.8, 0.0): 0.1, (-0.6, -0.6): 0.2, (-0.6, 0.6): 0.1, (0.6, 0.6): 0.2, (-1.25, -0.6): 0.2}),
        (
            "avoid_holes",
            {(-2.9, -1.15): 0.0, (-1.7, 1.15): 0.0, (0.0, 1.15): 0.0, (0.0, -1.15): -0.14, (-2.9, 1.15): -0.14},
        ),
        ("door", {(0.0, 0.6): 0.0, (0.0, 0.14): 2.0, (0.0, 1.06): 2.0, (0.0, -0.6): 1.2}),
    ],
)
def test_the_ground_is_as_high_as_said(lane, heights):
    world = loaded(lane)
    assert {place: height(world, *place) for place in heights} == pytest.approx(heights, abs=2e-3)


def test_passages_are_as_wide_as_said():
    assert between(loaded("door"), (0, 0.6, 0.6), (0, 1, 0)) == pytest.approx(0.9, abs=1e-6)
    tilted = between(loaded("traverse"), (0.0, 0.0, 1.2 * SIN + 0.4), (0, COS, SIN))
    assert tilted == pytest.approx(LANES["traverse"].passage, abs=1e-6)
    alleys = loaded("alleys")
    for x, side in ((-1.2, -1), (0.0, 1), (1.2, -1)):
        # Of the panel, which stands 3.8 cm before the railing's plane.
        place = (x - 0.038, side * 1.19, 0.7)
        assert 0.01 + reach(alleys, place, (0, -side, 0)) == pytest.approx(LANES["alleys"].passage, abs=1e-6)
    gate = loaded("avoid_holes")
    for x, y, ray in ((-2.25, -1.15, (0, 1, 0)), (-1.7, 0.6, (1, 0, 0)), (0.05, 1.15, (0, 1, 0))):
        assert between(gate, (x, y, 0.3), ray) == pytest.approx(LANES["avoid_holes"].passage, abs=1e-6)


def test_posts_stand_by_themselves_and_fall_when_pushed():
    model, data = loaded("avoid_holes")
    posts = [body for body in range(model.nbody) if model.body(body).name.startswith("post_")]
    assert len(posts) == 10
    mujoco.mj_step(model, data, nstep=500)
    assert (data.xmat[posts, 8] > 0.999).all()
    data.xfrc_applied[posts[0], 1] = 3.0
    mujoco.mj_step(model, data, nstep=500)
    assert data.xmat[posts[0], 8] < 0.5
    assert (data.xmat[posts[4:], 8] > 0.999).all()  # those of the other gates


@pytest.mark.parametrize(("lane", "opens"), [("door", 100), ("door_shut", 0)])
def test_a_leaf_stands_where_it_is_held(lane, opens):
    model, data = loaded(lane)
    mujoco.mj_step(model, data, nstep=1000)
    along = data.geom("leaf").xmat.reshape(3, 3)[:, 0]
    assert math.degrees(math.atan2(along[0], along[1])) == pytest.approx(opens, abs=1)
    assert model.body("leaf").mass == pytest.approx(12)


@pytest.mark.parametrize(
    ("lane", "reason"),
    [
        ("hurdles", "a step of 0.1 m; the robot can climb at most 0.04 m"),
        ("krails", "a step of 0.1 m; the robot can climb at most 0.04 m"),
        ("stepfield", "a step of 0.15 m; the robot can climb at most 0.04 m"),
        ("pitch_roll", "a step of 0.063 m; the robot can climb at most 0.04 m"),
        ("door_shut", "a lever 1 m above the floor; the robot has no arm"),
        ("crossing_ramps", None),
        ("avoid_holes", None),
        ("alleys", "a doorway of 0.597 m in a corner; to turn into it, the robot needs 0.604 m"),
        ("traverse", None),
    ],
)
def test_what_a_pioneer_cannot(lane, reason):
    assert LANES[lane].unsuitability(PIONEER) == reason


def test_other_bodies_have_other_limits():
    tender, wide = replace(PIONEER, max_tilt=math.radians(10)), replace(PIONEER, width=0.6)
    assert "15°" in LANES["crossing_ramps"].unsuitability(tender)
    assert "0.6 m wide" in LANES["alleys"].unsuitability(wide)
    assert LANES["alleys"].unsuitability(replace(PIONEER, length=0.4)) is None
    assert LANES["krails"].unsuitability(replace(PIONEER, max_step=0.1)) is None


def test_steps_between_pitch_and_roll_ramps_are_as_high_as_said():
    """Where a robot's side passes from one ramp to the next, in the middle of an element."""
    world, half = loaded("pitch_roll"), PIONEER.width / 2
    steps = [
        abs(height(world, -0.6 + s * 1e-3, -0.6 + side * half) - height(world, -0.6 - s * 1e-3, -0.6 + side * half))
        for s in (4,)
        for side in (-1, 1)
    ]
    assert max(steps) == pytest.approx(LANES["pitch_roll"].twist * half, abs=2e-3)
