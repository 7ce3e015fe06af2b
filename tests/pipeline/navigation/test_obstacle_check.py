"""What the obstacle check finds."""

import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.navigation.config import ObstacleCheckConfig
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.sensor import XTION
from tests.pipeline.worlds import flat, ground_points, ridge, surface_of, wall_points

START, TARGET = np.array([0.0, 0.0]), np.array([2.0, 0.0])
FLOOR = assess_map(surface_of(ground_points(flat, (-1, 4), (-1, 1))))


class Watch:
    """A check with a camera that always sees the same points."""

    def __init__(self, *seen, traversability=FLOOR):
        self.check = ObstacleCheck(traversability, XTION, ObstacleCheckConfig())
        self.looks, self._cloud = 0, np.vstack(seen).astype(np.float32)

    def is_clear(self, position, target):
        if self.check.is_due(position, target):
            self.looks += 1
            self.check.look(position, target, self._cloud)
        return self.check.is_clear(position, target)


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
    assert watch.is_clear(START, TARGET) == clear
    assert (len(watch.check.obstacles) == 0) == clear


def test_what_the_map_knows_is_no_news():
    walled = assess_map(surface_of(ground_points(flat, (-1, 4), (-1, 1)), wall_points((1.5, -1), (1.5, 1))))
    assert Watch(wall_points((1.5, -1), (1.5, 1)), traversability=walled).is_clear(START, TARGET)


def test_a_ramp_is_no_obstacle():
    traversability = assess_map(surface_of(ground_points(ridge, (-2, 2), (-1, 1))))
    seen = ground_points(ridge, (-1, 1), (-1, 1))
    assert Watch(seen, traversability=traversability).is_clear(np.array([-1.5, 0.0]), np.array([1.5, 0.0]))


def test_what_stands_behind_the_way_point_does_not_matter():
    assert Watch(box(1.5, 0.0)).is_clear(START, np.array([1.1, 0.0]))
    assert not Watch(box(1.4, 0.0)).is_clear(START, np.array([1.1, 0.0]))


def test_it_checks_at_each_new_way_point_and_every_stride():
    watch = Watch(np.zeros((0, 3)))
    for x in np.arange(0, 1.0, 0.01):
        assert watch.is_clear(np.array([x, 0.0]), TARGET)
    assert watch.looks == 3
    assert watch.is_clear(np.array([1.0, 0.0]), np.array([1.0, 2.0]))
    assert watch.looks == 4
    assert watch.is_clear(np.array([1.0, 1.9]), np.array([1.2, 1.9]))  # nearer than the camera sees
    assert watch.looks == 4
