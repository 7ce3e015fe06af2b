"""Each lane loads, has the size and the slope that it is said to have, and asks of a body what stands in it."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from sarsim.arenas.lanes import LANES
from sarsim.arenas.load import load_arena
from sarsim.assets import asset
from sarsim.robots.model import robot_model

RISE = 2.4 * math.tan(math.radians(15))
"""m, over the 2.4 m between the end zones."""
PIONEER = robot_model()


def loaded(lane):
    """The model and the data of a lane."""
    model = mujoco.MjModel.from_xml_string(load_arena(f"lanes/{lane}").to_xml())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def reach(world, start, ray):
    """m to what a ray meets."""
    geom = np.full(1, -1, np.int32)
    return mujoco.mj_ray(*world, np.array(start, float), np.array(ray, float), None, 1, -1, geom)


def height(world, x, y):
    """m, of what lies uppermost."""
    return 3 - reach(world, (x, y, 3), (0, 0, -1))


def test_every_file_is_a_lane():
    files = {path.stem for path in asset("arenas", "lanes").glob("*.xml")}
    assert files == {*LANES, "lane"}


@pytest.mark.parametrize("lane", LANES)
def test_a_lane_has_its_size(lane):
    world = loaded(lane)
    for x in (-1.8, 1.8):
        middle = height(world, x, 0) + 0.3
        across = reach(world, (x, 0, middle + 0.1), (0, 1, 0)) + reach(world, (x, 0, middle + 0.1), (0, -1, 0))
        if lane != "traverse":  # its floor rises towards one side
            assert across == pytest.approx(2.4, abs=1e-6)
        assert reach(world, (x, 0.9, middle + 0.2), (math.copysign(1, x), 0, 0)) == pytest.approx(0.6, abs=1e-6)
    assert world[1].site("start").xpos[2] == pytest.approx(height(world, -1.8, 0), abs=1e-5)


@pytest.mark.parametrize(
    ("lane", "heights"),
    [
        ("crossing_ramps", {(-0.9, 0.6): 0.3 * math.tan(math.radians(15)), (-0.61, 0.6): 0.59 * RISE / 2.4}),
        ("crossing_ramps", {(-1.19, -0.6): 0.59 * RISE / 2.4, (-0.3, -0.6): 0.3 * RISE / 2.4}),
        ("krails", {(-0.6, 0.6): 0.1, (0.6, -0.6): 0.1, (-0.6, 0.0): 0.0}),
        ("krails_15", {(-0.6, 0.0): RISE / 4, (0.6, 0.0): RISE * 3 / 4, (1.8, 0.0): RISE}),
        ("stepfield", {(-1.05, -1.05): 0.15, (-0.75, -1.05): 0.0}),
        ("traverse", {(0.0, -0.2): RISE * 1.0 / 2.4, (0.0, 0.2): RISE * 1.4 / 2.4, (-1.8, 1.0): RISE * 2.2 / 2.4}),
        ("centre", {(-0.6, 0.0): RISE / 4, (0.6, 0.2): RISE * 3 / 4, (0.0, 0.31): 1.2}),
        ("hurdles", {(-0.8, 0.0): 0.2, (0.0, 0.0): 0.0, (0.8, 1.0): 0.2}),
        ("avoid_holes", {(-0.9, -0.6): 0.0, (-0.9, 0.6): -0.1, (0.0, 0.6): 0.0, (0.9, -0.6): -0.1, (0.9, 0.6): 0.0}),
        ("door", {(0.0, 0.0): 0.0, (0.0, 0.46): 1.2, (0.0, -0.46): 1.2}),
    ],
)
def test_the_ground_is_as_high_as_said(lane, heights):
    world = loaded(lane)
    assert {place: height(world, *place) for place in heights} == pytest.approx(heights, abs=1e-5)


def test_passages_are_as_wide_as_said():
    ways = {"centre": (0, 0, 0.8), "traverse": (0, 0, 0.8), "door": (0, 0, 0.6)}
    for lane, place in ways.items():
        world = loaded(lane)
        width = reach(world, place, (0, 1, 0)) + reach(world, place, (0, -1, 0))
        assert width == pytest.approx(LANES[lane].passage, abs=1e-6)
    gate = loaded("avoid_holes")
    for x, y in ((-1.17, -0.6), (-0.63, -0.6), (0.63, 0.6), (1.17, 0.6)):
        width = reach(gate, (x, y, 0.3), (0, 1, 0)) + reach(gate, (x, y, 0.3), (0, -1, 0))
        assert width == pytest.approx(LANES["avoid_holes"].passage, abs=1e-6)


def test_posts_stand_by_themselves_and_fall_when_pushed():
    model, data = loaded("avoid_holes")
    posts = [body for body in range(model.nbody) if model.body(body).name.startswith("post_")]
    assert len(posts) == 10
    mujoco.mj_step(model, data, nstep=500)
    assert (data.xmat[posts, 8] > 0.999).all()
    data.xfrc_applied[posts[0], 0] = 3.0
    mujoco.mj_step(model, data, nstep=500)
    assert data.xmat[posts[0], 8] < 0.5
    assert (data.xmat[posts[4:], 8] > 0.999).all()  # those of the other gates


@pytest.mark.parametrize(
    ("lane", "reason"),
    [
        ("hurdles", "a step of 0.2 m, at most 0.04 m are driven over"),
        ("krails", "a step of 0.1 m, at most 0.04 m are driven over"),
        ("stepfield", "a step of 0.15 m, at most 0.04 m are driven over"),
        ("crossing_ramps", None),
        ("avoid_holes", None),
        ("traverse", None),
    ],
)
def test_a_pioneer_cannot_climb_steps(lane, reason):
    assert LANES[lane].cannot(PIONEER) == reason


def test_other_bodies_have_other_limits():
    tender, wide = replace(PIONEER, max_tilt=math.radians(10)), replace(PIONEER, width=0.6)
    assert "15°" in LANES["crossing_ramps"].cannot(tender)
    assert "0.597 m" in LANES["traverse"].cannot(wide)
    assert LANES["krails"].cannot(replace(PIONEER, max_step=0.1)) is None
