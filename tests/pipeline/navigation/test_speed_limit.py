"""How fast the robot may drive over what its map shows."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.navigation.speed_limit import SpeedLimit
from pipeline.planning.stretches import Stretch
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import RUN, flat, ground_points, ridge, surface_of, wall_points

EAST, WEST = 0.0, np.pi


def speed_limit(world, speed=0.5, **semantic):
    return SpeedLimit(replace(assess_map(world), robot=replace(PIONEER, speed=speed)), **semantic)


def line(x, y=0.0, direction=EAST, length=3.0):
    """A straight stretch whose first pose is at (x, y)."""
    along = np.arange(0, length, 0.02)
    poses = np.column_stack(
        [x + along * np.cos(direction), y + along * np.sin(direction), np.full(len(along), direction)]
    )
    return Stretch(poses, False)


def test_it_slows_down_before_a_ramp_and_not_behind_it():
    at = speed_limit(surface_of(ground_points(ridge, (-4, 4), (-2, 2))))
    assert at(line(-3.0))[0] == 0.5
    assert at(line(-RUN - 0.3))[0] == PIONEER.ramp_speed
    assert at(line(-RUN - 0.6, direction=WEST, length=1.5))[0] == 0.5
    assert at(line(-0.3))[0] == PIONEER.ramp_speed


@pytest.mark.parametrize("speed", [0.5, 0.7, 2.0])
def test_it_can_brake_in_time(speed):
    at = speed_limit(surface_of(ground_points(ridge, (-4, 4), (-2, 2))), speed)
    speeds = at(line(-3.0))
    assert (np.diff(np.square(speeds)) >= -2 * PIONEER.acceleration * 0.02 - 1e-6).all()
    assert speeds[0] > 0.4 > 0.2 > speeds[-1]


def test_the_less_room_is_left_the_slower_it_is():
    world = surface_of(ground_points(flat, (-3, 3), (-2, 2)), wall_points((-1, 0.4), (3, 0.4)))
    at = speed_limit(world)
    assert at(line(-2.5, length=0.5))[0] == 0.5
    speeds = [at(line(1.0, y, length=0.5))[0] for y in (-0.4, 0.0, 0.05, 0.1)]
    assert speeds[0] == 0.5 > speeds[1] >= speeds[2] >= speeds[3] >= 0.2
    assert speeds[3] < 0.4


def test_the_tighter_an_arc_the_slower_it_is():
    at = speed_limit(surface_of(ground_points(flat, (-3, 3), (-3, 3))))
    around = np.linspace(0, np.pi / 2, 100)
    speeds = [
        at(Stretch(np.column_stack([r * np.sin(around), r - r * np.cos(around), around]), False)).min()
        for r in (1.5, 0.5, 0.25)
    ]
    assert speeds == pytest.approx([0.5, 2 * speeds[2], speeds[2]], rel=0.01)
    assert speeds[1] < 0.5


@pytest.mark.parametrize(("angle", "slowest"), [(-14, 0.18), (3, 0.5), (14, 0.18)])
def test_a_bend_without_an_arc_slows_it_down_so_that_it_stays_near_its_line(angle, slowest):
    at = speed_limit(surface_of(ground_points(flat, (-4, 4), (-3, 3))))
    bent = line(-1.5, length=1.5).joined_with(line(0.0, direction=np.deg2rad(angle), length=2.0))
    assert at(bent).min() == pytest.approx(slowest, abs=0.02)


def test_an_arc_after_a_bend_slows_it_down_no_more_than_the_arc_alone():
    at = speed_limit(surface_of(ground_points(flat, (-3, 3), (-3, 3))))
    around = np.linspace(0, np.pi / 2, 24)
    arc = Stretch(np.column_stack([0.3 * np.sin(around), 0.3 - 0.3 * np.cos(around), around]), False)
    bent = line(-1.5, length=1.5).moved(from_yaw(0, 0, 0, np.deg2rad(-10))).joined_with(arc)
    assert at(bent).min() == pytest.approx(at(arc).min())


def test_it_is_slow_on_what_the_semantic_map_calls_a_ramp_and_beside_a_person():
    world, east = surface_of(ground_points(flat, (-4, 6), (-2, 2))), np.array([2.0, 0.0, 0.1])
    spots = np.array([[-3.0, 0.0], [1.9, 0.0], [1.9, 0.9], [3.5, 0.0]])
    on_ramp, with_person = (
        speed_limit(world, ramps=[east[None]]),
        speed_limit(world, people=[east[None], east[None] + (0, 0, 1)]),
    )
    assert [on_ramp(line(*xy, length=1.0))[0] for xy in spots[[0, 1, 3]]] == [0.5, PIONEER.ramp_speed, 0.5]
    assert [with_person(line(*xy, length=1.0))[0] for xy in spots] == [0.5, 0.2, 0.2, 0.5]
