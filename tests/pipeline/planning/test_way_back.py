"""The way back along the track out of ground to which no path leads any more."""

import numpy as np
import pytest

from pipeline.elevation_map.traversability import Traversability, assess_map
from pipeline.planning.path_plan import PathPlan
from pipeline.planning.pose_paths import PosePaths
from pipeline.planning.way_back import way_back
from pipeline.transforms import from_yaw, yaw_of
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points

TRACK = [(x, 0.0, 0.0) for x in np.arange(-2.5, 2.6, 0.25)]
"""Poses of a drive straight ahead."""


@pytest.fixture(scope="module")
def cut() -> Traversability:
    """A hall cut in two by a wall at x = 1 that was seen only after the robot had passed."""
    return assess_map(surface_of(ground_points(flat, (-3, 3.5), (-1, 1)), wall_points((1, -1), (1, 1))))


def plan_back(ground: Traversability, track: list[tuple[float, float, float]]) -> PathPlan | None:
    poses = np.array([from_yaw(x, y, 0, yaw) for x, y, yaw in track])
    return way_back(poses, PosePaths(ground, poses[-1, :2, 3], yaw_of(poses[-1])))


@pytest.mark.parametrize(("last", "is_backwards"), [([], True), ([(2.5, 0.0, np.pi / 2), (2.5, 0.0, np.pi)], False)])
def test_the_robot_goes_back_along_its_track_without_turning_round(cut, last, is_backwards):
    plan = plan_back(cut, TRACK + last)
    assert (np.diff(plan.waypoints[:, 0]) < 0).all() and not plan.waypoints[:, 1].any()
    assert 0 < plan.waypoints[-1, 0] < 0.8
    assert (plan.backwards == is_backwards).all()
    assert plan.length == pytest.approx(2.5 - plan.waypoints[-1, 0])


def test_a_track_with_a_corner_is_followed_back_round_it(cut):
    north = [(2.5, y, np.pi / 2) for y in (0.0, 0.25, 0.5)]
    plan = plan_back(cut, TRACK + north)
    np.testing.assert_allclose(plan.waypoints[:3, :2], [(2.5, 0.25), (2.5, 0), (2.25, 0)], atol=1e-6)
    assert plan.backwards.all()


def test_who_reaches_most_of_the_track_needs_no_way_back(cut):
    assert plan_back(cut, TRACK[:14]) is None
    assert plan_back(cut, TRACK[-8:]) is None


def test_nor_is_there_one_from_where_the_robot_was_set_down(cut):
    assert plan_back(cut, [(1.0, 0.0, 0.0)]) is None


def test_the_robot_does_not_drive_where_it_was_carried(cut):
    assert plan_back(cut, [pose for pose in TRACK if not 0.2 < pose[0] < 1.8]) is None
