"""What the obstacle check finds."""

import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.navigation.commands import Approach
from pipeline.navigation.config import ObstacleCheckConfig
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.planning.stretches import Stretch
from pipeline.sensor import XTION
from tests.pipeline.worlds import flat, ground_points, ridge, surface_of, wall_points

START, TARGET = np.array([0.0, 0.0]), np.array([2.0, 0.0])
FLOOR = assess_map(surface_of(ground_points(flat, (-1, 4), (-1, 1))))


def straight(start, target):
    """The stretch from one place to another."""
    number = 2 + int(np.linalg.norm(target - start) / 0.02)
    direction = np.arctan2(*(target - start)[::-1])
    return Stretch(np.column_stack([np.linspace(start, target, number), np.full(number, direction)]), False)


class Watch:
    """A check with a camera that always sees the same points."""

    def __init__(self, *seen, traversability=FLOOR):
        self.check = ObstacleCheck(traversability, XTION, ObstacleCheckConfig())
        self.looks, self._cloud = 0, np.vstack(seen).astype(np.float32)

    def is_clear(self, stretch, at=0):
        command = Approach(0.2, stretch=stretch, at=at)
        if self.check.is_due(command):
            self.looks += 1
            self.check.look(command, self._cloud)
        return self.check.is_clear(command)


def box(x, y, height=0.4):
    """The front of a box 0.2 m wide."""
    return wall_points((x, y - 0.1), (x, y + 0.1), height)


@pytest.mark.parametrize(
    ("seen", "clear"),
    [
        (ground_points(flat, (1, 3), (-1, 1)), True),
        (box(1.5, 0.0), False),
        (box(1.5, 0.3), False),  # its edge reaches into the corridor
        (box(1.5, 0.5), True),  # beside it
        (box(2.2, 0.0), True),  # further than it looks
        (box(-0.5, 0.0), True),  # behind the robot
        (box(1.5, 0.0, height=0.1), True),  # the robot rolls over it
        (np.add(box(1.5, 0.0), (0, 0, 1)), True),  # the robot passes below it
        (box(1.5, 0.0)[::60], True),  # noise
    ],
)
def test_what_stands_in_the_corridor_is_in_the_way(seen, clear):
    watch = Watch(seen)
    assert watch.is_clear(straight(START, TARGET)) == clear
    assert (len(watch.check.obstacles) == 0) == clear


def test_what_the_map_knows_is_no_news():
    walled = assess_map(surface_of(ground_points(flat, (-1, 4), (-1, 1)), wall_points((1.5, -1), (1.5, 1))))
    assert Watch(wall_points((1.5, -1), (1.5, 1)), traversability=walled).is_clear(straight(START, TARGET))


@pytest.mark.parametrize(("y", "is_clear"), [(0.0, False), (0.2, False), (-0.2, False), (0.33, True)])
def test_between_walls_it_sees_what_stands_anywhere_on_its_path(y, is_clear):
    walls = [wall_points((-1, side), (4, side)) for side in (-0.38, 0.38)]
    passage = assess_map(surface_of(ground_points(flat, (-1, 4), (-0.38, 0.38)), *walls))
    post = wall_points((1.5, y - 0.02), (1.5, y + 0.02), 0.5)
    seen = np.vstack([*walls, post, post])
    assert Watch(seen, traversability=passage).is_clear(straight(START, TARGET)) == is_clear


def test_a_ramp_is_no_obstacle():
    traversability = assess_map(surface_of(ground_points(ridge, (-2, 2), (-1, 1))))
    seen = ground_points(ridge, (-1, 1), (-1, 1))
    assert Watch(seen, traversability=traversability).is_clear(straight(np.array([-1.5, 0.0]), np.array([1.5, 0.0])))


def test_what_stands_behind_the_way_point_does_not_matter():
    assert Watch(box(1.5, 0.0)).is_clear(straight(START, np.array([1.1, 0.0])))
    assert not Watch(box(1.4, 0.0)).is_clear(straight(START, np.array([1.1, 0.0])))


def test_what_stands_beside_a_line_may_stand_on_an_arc():
    around = np.linspace(0, np.pi / 2, 100)
    arc = Stretch(np.column_stack([0.6 * np.sin(around), 0.6 - 0.6 * np.cos(around), around]), False)
    assert not Watch(box(0.55, 0.5)).is_clear(arc)
    assert Watch(box(1.5, 0.0)).is_clear(arc)


def test_however_short_a_piece_of_the_path_it_looks_at_the_piece_has_a_direction():
    check = ObstacleCheck(FLOOR, XTION, ObstacleCheckConfig(ahead=0.001))
    check.look(Approach(0.2, stretch=straight(START, TARGET), at=0), box(1.5, 0.0))
    assert not len(check.obstacles)


def test_it_checks_each_new_stretch_and_at_every_stride():
    watch, first, second = Watch(np.zeros((0, 3))), straight(START, TARGET), straight(TARGET, np.array([2.0, 2.0]))
    for at in range(50):
        assert watch.is_clear(first, at)
    assert watch.looks == 3
    assert watch.is_clear(second)
    assert watch.looks == 4
    assert watch.is_clear(second, len(second.poses) - 10)  # nearer than the camera sees
    assert watch.looks == 4


def lying(x, y):
    """The points of a hand on the floor."""
    return np.array([(x, y, 0.04)]) + np.linspace(-0.05, 0.05, 7)[:, None] * (1, 0, 0)


@pytest.mark.parametrize(
    ("known", "seen", "meets"),
    [
        ([], [], False),
        ([], [lying(1.0, 0.1)], True),
        ([], [lying(3.0, 0.0), lying(1.0, 0.1)], True),
        ([], [lying(1.0, 0.5)], True),  # within the distance at which the robot drives slowly
        ([], [lying(1.0, 0.7)], False),
        ([lying(1.0, 0.7)], [np.vstack([lying(1.0, 0.7), lying(1.0, 0.4)])], True),  # 0.15 m beside the body
        ([lying(1.0, 0.8)], [np.vstack([lying(1.0, 0.8), lying(1.0, 0.5)])], False),
        ([], [lying(-0.5, 0.0)], False),  # behind the robot
        ([lying(1.0, 0.3)], [lying(1.0, 0.1)], False),  # the plan keeps off
        ([lying(1.0, 0.4)], [lying(1.0, 0.4), lying(1.0, 0.1)], True),
    ],
)
def test_a_part_of_a_person_that_the_plan_did_not_know_is_in_the_way(known, seen, meets):
    check = ObstacleCheck(FLOOR, XTION, ObstacleCheckConfig(), known, beside_people=0.6)
    assert check.meets_person(seen, Approach(0.2, stretch=straight(START, TARGET), at=0)) == meets
