"""How fast the robot may drive over what its map shows."""

from dataclasses import replace

import numpy as np

from pipeline.navigation.pace import Pace
from pipeline.traversability.traversability import NARROW_SPEED, assess_map
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import RUN, flat, ground_points, ridge, surface_of, wall_points

EAST, WEST = np.array([1.0, 0.0]), np.array([-1.0, 0.0])


def pace(world):
    return Pace(replace(assess_map(world), robot=replace(PIONEER, speed=0.5)))


def test_it_slows_down_before_a_ramp_and_not_behind_it():
    at = pace(surface_of(ground_points(ridge, (-4, 4), (-2, 2))))
    assert at(np.array([-3.0, 0.0]), EAST) == 0.5
    assert at(np.array([-RUN - 0.6, 0.0]), EAST) == PIONEER.ramp_speed
    assert at(np.array([-RUN - 0.6, 0.0]), WEST) == 0.5
    assert at(np.array([-0.3, 0.0]), EAST) == PIONEER.ramp_speed


def test_it_is_slow_where_there_is_little_room():
    world = surface_of(ground_points(flat, (-3, 3), (-2, 2)), wall_points((0, 0.4), (3, 0.4)))
    at = pace(world)
    assert at(np.array([-2.0, 0.0]), EAST) == 0.5
    assert at(np.array([-0.6, 0.0]), EAST) == NARROW_SPEED
    assert at(np.array([1.0, -1.0]), EAST) == 0.5
