"""A P3-AT stands and drives in arenas of many elements."""

import numpy as np
import pytest
from dm_control import mjcf

from pipeline.robot import Velocity
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.load import load_arena
from sarsim.environment import CONTROL_TIMESTEP, RescueEnvironment

SPEED = 0.2
SINKS = 0.004
"""m; the tyres are soft, on an edge they sink a little deeper than the 1 mm at rest."""

LANES = {
    "ridges of half ramps": [
        ("half_ramp", 1, 270),
        ("half_ramp", 1, 90),
        ("half_ramp", 2, 270),
        ("half_ramp", 2, 90),
    ],
    "full ramps": [("full_ramp", 1, 90), ("full_ramp", 2, 270)],
    "a shifted ramp and a half ramp": [("half_ramp_shifted", 1, 90), ("half_ramp_shifted", 2, 270)],
    "a deck of 17 cm": [("ramp_17", 1, 90), ("deck_17", 2, 0), ("deck_17", 3, 0), ("ramp_17", 4, 270)],
    "a deck of 34 cm": [("ramp_34", 1, 90), ("deck_34", 2, 0), ("ramp_34", 3, 270)],
    "floor tiles": [("floor_tile_black", 1, 0), ("floor_tile_white", 2, 0), ("floor_tile_black", 3, 0)],
}
"""Elements in a row along x: kind, tile, degrees."""


def lane(elements):
    """A lane of six tiles between walls, as an arena; the robot starts in the middle of the first tile."""
    builder = ArenaBuilder("lane")
    for tile in range(7):
        for yaw in (0, 180):
            builder.add_element("small_wall", (1.2 * tile, 0, 0), yaw)
    for kind, tile, yaw in elements:
        builder.add_element(kind, (1.2 * tile, 0, 0), yaw)
    low, high = builder.bounds
    builder.add_floor(low - 1, high + 1)
    builder.add_surroundings(low, high)
    builder.set_start((0, 0, 0), 0)
    return RescueArena(mjcf.from_xml_string(builder.to_xml()))


@pytest.mark.parametrize("name", sorted(LANES))
def test_it_drives_over_ramps_and_the_seams_between_them(name):
    environment = RescueEnvironment(lane(LANES[name]))
    robot, physics = environment.robot, environment.physics
    deepest, steepest, slowest = 0.0, 0.0, np.inf
    for step in range(round(30 / CONTROL_TIMESTEP)):
        before = robot.T_world_base(physics)[:3, 3]
        environment.drive(Velocity(SPEED))
        T = robot.T_world_base(physics)
        deepest = min(deepest, physics.data.contact.dist.min(initial=0))
        steepest = max(steepest, np.arccos(T[2, 2]))
        if step * CONTROL_TIMESTEP > 1.5:
            slowest = min(slowest, np.linalg.norm(T[:3, 3] - before) / CONTROL_TIMESTEP)
    environment.close()
    x, y, _ = T[:3, 3]
    assert 5.6 < x < 6.1
    assert abs(y) < 0.05
    assert np.degrees(steepest) < 18
    assert deepest > -SINKS
    assert slowest > 0.4 * SPEED


def field(kind, yaw_deg):
    """A field of ridges, side by side and in a row, 2 cm apart; the robot starts west of it, heading ``yaw_deg``."""
    builder = ArenaBuilder("field")
    for column in range(1, 5):
        for row in range(-1, 3):
            for turn in RIDGES[kind][column % 2]:
                builder.add_element(kind, (1.2 * column, 1.2 * row, 0), turn)
    low, high = builder.bounds
    builder.add_floor(low - 3, high + 3)
    builder.add_surroundings(low, high)
    builder.set_start((0, -0.7, 0), np.radians(yaw_deg))
    return RescueArena(mjcf.from_xml_string(builder.to_xml()))


RIDGES = {"half_ramp": ((90, -90), (90, -90)), "full_ramp": ((-90,), (90,))}
"""Yaws in degrees of the elements in even and in odd columns."""


@pytest.mark.parametrize(("kind", "yaw_deg"), [("half_ramp", 25), ("full_ramp", 10), ("full_ramp", 25)])
def test_no_wheel_is_caught_in_a_seam_that_it_crosses_aslant(kind, yaw_deg):
    environment = RescueEnvironment(field(kind, yaw_deg))
    robot, physics = environment.robot, environment.physics
    deepest, slowest = 0.0, np.inf
    for step in range(round(24 / CONTROL_TIMESTEP)):
        before = robot.T_world_base(physics)[:3, 3]
        environment.drive(Velocity(SPEED))
        place = robot.T_world_base(physics)[:3, 3]
        deepest = min(deepest, physics.data.contact.dist.min(initial=0))
        if step * CONTROL_TIMESTEP > 1.5:
            slowest = min(slowest, np.linalg.norm(place - before) / CONTROL_TIMESTEP)
    environment.close()
    assert place[0] > 4.0
    assert slowest > 0.8 * SPEED
    assert deepest > -SINKS


def test_it_stands_still_and_nothing_sinks_in():
    environment = RescueEnvironment(load_arena("random:2"))
    robot, physics = environment.robot, environment.physics
    before = robot.T_world_base(physics)[:3, 3]
    for _ in range(round(10 / CONTROL_TIMESTEP)):
        environment.drive(Velocity())
    assert np.linalg.norm(robot.T_world_base(physics)[:3, 3] - before) < 0.005
    assert physics.data.contact.dist.min() > -0.002
    assert not np.any([warning.number for warning in physics.data.warning])
    environment.close()
