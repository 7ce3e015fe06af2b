"""How fast the robot may drive over what its map shows."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.navigation.speed_limit import SpeedLimit
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import RUN, flat, ground_points, ridge, surface_of, wall_points

EAST, WEST = np.array([1.0, 0.0]), np.array([-1.0, 0.0])


def speed_limit(world, speed=0.5, **semantic):
    return SpeedLimit(replace(assess_map(world), robot=replace(PIONEER, speed=speed)), **semantic)


def test_it_slows_down_before_a_ramp_and_not_behind_it():
    at = speed_limit(surface_of(ground_points(ridge, (-4, 4), (-2, 2))))
    assert at(np.array([-3.0, 0.0]), EAST) == 0.5
    assert at(np.array([-RUN - 0.3, 0.0]), EAST) == PIONEER.ramp_speed
    assert at(np.array([-RUN - 0.6, 0.0]), WEST) == 0.5
    assert at(np.array([-0.3, 0.0]), EAST) == PIONEER.ramp_speed


@pytest.mark.parametrize("speed", [0.5, 0.7, 2.0])
def test_it_can_brake_in_time(speed):
    at = speed_limit(surface_of(ground_points(ridge, (-4, 4), (-2, 2))), speed)
    speeds = [at(np.array([x, 0.0]), EAST) for x in np.arange(-3.0, -RUN, 0.05)]
    assert (np.diff(np.square(speeds)) >= -PIONEER.acceleration * 0.05 - 1e-6).all()
    assert speeds[0] > 0.4 > 0.2 > speeds[-1]


def test_the_less_room_is_left_the_slower_it_is():
    world = surface_of(ground_points(flat, (-3, 3), (-2, 2)), wall_points((-1, 0.4), (3, 0.4)))
    at = speed_limit(world)
    assert at(np.array([-2.5, 0.0]), EAST) == 0.5
    speeds = [at(np.array([1.0, y]), EAST) for y in (-0.4, 0.0, 0.05, 0.1)]
    assert speeds[0] == 0.5 > speeds[1] >= speeds[2] >= speeds[3] >= 0.2
    assert speeds[3] < 0.4


def test_it_is_slow_on_what_the_semantic_map_calls_a_ramp_and_beside_a_person():
    world, east = surface_of(ground_points(flat, (-4, 6), (-2, 2))), np.array([2.0, 0.0, 0.1])
    spots = np.array([[-3.0, 0.0], [1.9, 0.0], [1.9, 0.9], [3.5, 0.0]])
    on_ramp, with_person = (
        speed_limit(world, ramps=[east[None]]),
        speed_limit(world, people=[east[None], east[None] + (0, 0, 1)]),
    )
    assert [on_ramp(xy, EAST) for xy in spots[[0, 1, 3]]] == [0.5, PIONEER.ramp_speed, 0.5]
    assert [with_person(xy, EAST) for xy in spots] == [0.5, 0.2, 0.2, 0.5]
