"""What frames are registered with: points that follow their keyframes, as a camera can see them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.local_map import LocalMap
from pipeline.localisation.registration import cloud_of
from pipeline.transforms import from_yaw
from tests.pipeline.worlds import ground_points, wall_points

CONFIG = LocalisationConfig()
WALL = cloud_of(wall_points((2, -1), (2, 1)), CONFIG.registration)
"""A wall before the robot, in ``base_link``."""
CAMERA = np.array([0.0, 0.0, 0.5])
BEHIND = np.array([4.0, 0.0, 0.5])
ALL = np.ones(WALL.size(), np.bool_)
AT_WALL = np.array([[2.0, -1.0, 0.0], [2.0, 1.0, 1.2]])


def local_map(*poses: NDArray[np.float64]) -> LocalMap:
    """A map of keyframes at these poses that have each seen the wall before them."""
    result = LocalMap(CONFIG)
    for owner, pose in enumerate(poses):
        result.add(owner, pose, WALL, CAMERA, ALL)
    return result


def test_a_wall_is_there_from_the_side_that_was_seen_alone() -> None:
    one_wall, known = local_map(np.eye(4)), np.ones(1, np.bool_)
    front = one_wall.around(AT_WALL, CAMERA, known, 0.5)
    assert front is not None
    assert len(front.owner) == WALL.size()
    assert one_wall.around(AT_WALL, BEHIND, known, 0.5) is None


def test_both_sides_of_a_thin_wall_are_two_surfaces() -> None:
    """The second keyframe stands at x = 4 and sees the same wall from behind."""
    both = local_map(np.eye(4), from_yaw(4, 0, 0, np.pi))
    for owner, camera in enumerate((CAMERA, BEHIND)):
        target = both.around(AT_WALL, camera, np.ones(2, np.bool_), 0.5)
        assert target is not None
        assert set(target.owner) == {owner}


def test_points_follow_their_keyframes() -> None:
    moved = local_map(np.eye(4), np.eye(4))
    moved.apply_poses(np.array([np.eye(4), from_yaw(0, 3, 0, np.pi / 2)]))
    points = moved.all_points()
    assert points.dtype == np.float32
    still, turned = np.split(points, 2)
    np.testing.assert_allclose(still, WALL.points()[:, :3], atol=1e-6)
    np.testing.assert_allclose(turned[:, 1], 5, atol=1e-6)
    assert moved.around(np.array([[0.0, 5.0, 0.5]]), np.array([0.0, 8.0, 0.5]), np.ones(2, np.bool_), 1.0) is None
    target = moved.around(np.array([[0.0, 5.0, 0.5]]), np.array([0.0, 3.0, 0.5]), np.ones(2, np.bool_), 1.0)
    assert target is not None
    assert set(target.owner) == {1}


def test_only_points_of_the_keyframes_asked_for_are_taken() -> None:
    both = local_map(np.eye(4), np.eye(4))
    target = both.around(AT_WALL, CAMERA, np.array([False, True]), 0.5)
    assert target is not None
    assert set(target.owner) == {1}
    assert both.around(AT_WALL, CAMERA, np.array([False, False]), 0.5) is None


@pytest.mark.parametrize(("margin", "is_there"), [(0.3, False), (0.7, True)])
def test_points_beyond_the_margin_are_not_taken(margin: float, is_there: bool) -> None:
    beside = AT_WALL - [0.5, 0, 0]
    target = local_map(np.eye(4)).around(beside, CAMERA, np.ones(1, np.bool_), margin)
    assert (target is not None) == is_there


def test_what_is_not_new_is_not_added_and_too_few_are_no_target() -> None:
    few = LocalMap(CONFIG)
    new = np.arange(WALL.size()) < 99
    few.add(0, np.eye(4), WALL, CAMERA, new)
    np.testing.assert_allclose(few.all_points(), WALL.points()[new, :3], atol=1e-6)
    assert few.around(AT_WALL, CAMERA, np.ones(1, np.bool_), 0.5) is None
    few.add(0, np.eye(4), WALL, CAMERA, ~new)
    assert few.around(AT_WALL, CAMERA, np.ones(1, np.bool_), 0.5) is not None


def test_the_ground_below_is_level_ground_within_the_foot_that_a_given_keyframe_saw() -> None:
    """Floor from x = 0.1, 0.1 m lower for the second keyframe, and a wall at x = 0.1."""
    below = LocalMap(CONFIG)
    floor, lower = (ground_points(lambda x, y, z=z: z + 0 * x, (0.1, 1.5), (-0.5, 0.5)) for z in (0.0, -0.1))
    for owner, points in enumerate((floor, lower, wall_points((0.1, -0.5), (0.1, 0.5)))):
        cloud = cloud_of(points, CONFIG.registration)
        below.add(owner, np.eye(4), cloud, np.array([-1.0, 0.0, 0.5]), np.ones(cloud.size(), np.bool_))
    heights, owners = below.ground_below(np.eye(4), np.array([True, False, False]))
    np.testing.assert_allclose(heights, 0, atol=1e-6)
    assert 0 < len(heights) < 0.5 * np.pi * 0.25**2 / 0.05**2
    assert set(owners) == {0}
    heights, owners = below.ground_below(from_yaw(0.8, 0, -0.05, np.pi / 2), np.ones(3, np.bool_))
    np.testing.assert_allclose(np.sort(heights), np.repeat([-0.05, 0.05], len(heights) // 2), atol=1e-6)
    assert set(owners) == {0, 1}
    heights, _ = below.ground_below(from_yaw(-1, 0, 0, 0), np.ones(3, np.bool_))
    assert len(heights) == 0
