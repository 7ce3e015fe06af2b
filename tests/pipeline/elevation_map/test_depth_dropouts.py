import numpy as np
import pytest

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.ground_evidence import find_depth_dropouts
from pipeline.frame import Intrinsics
from pipeline.sensor import XTION
from tests.pipeline.robot_model import PIONEER

WIDE = Intrinsics(width=101, height=8, fx=100.0, fy=100.0, cx=50.5, cy=-58.0)
"""A camera of which every row shows the ground when it looks level."""
LEVEL = np.array([(0.0, 0, 1, 0), (-1, 0, 0, 0), (0, -1, 0, 0.6), (0, 0, 0, 1)])
"""A camera 0.6 m above the origin that looks along x."""


def ground_depth() -> np.ndarray:
    """What the camera sees of level ground: the same depth along each row."""
    rows = np.arange(WIDE.height) + 0.5
    return np.repeat((0.6 * WIDE.fy / (rows - WIDE.cy)).astype(np.float32)[:, None], WIDE.width, axis=1)


NEAR = 0.5
"""Distance around the origin in which nothing stands."""


def all_dropouts(depth):
    return find_depth_dropouts(depth, WIDE, LEVEL, XTION, NEAR)


def dropouts(depth):
    """Those on the ground that is seen on both sides."""
    points = all_dropouts(depth)
    return points[points[:, 2] < 0.3]


def test_nothing_is_missing_on_open_ground():
    assert dropouts(ground_depth()).shape == (0, 3)


@pytest.mark.parametrize("nearer", [0.0, 0.4])
def test_a_stripe_without_ground_is_missing_where_the_ground_would_be(nearer):
    depth = ground_depth()
    depth[:, 48:53] = nearer
    points = dropouts(depth)
    assert points.shape == (5 * WIDE.height // 2, 3)
    np.testing.assert_allclose(points[:, 2], 0, atol=1e-5)
    np.testing.assert_allclose(points[:5, 0], ground_depth()[0, 0], rtol=1e-5)
    np.testing.assert_allclose(points[:5, 1], ground_depth()[0, 0] * np.arange(2, -3, -1) / 100, atol=1e-5)


@pytest.mark.parametrize("width", [2, 61])
def test_frayed_pixels_and_wide_shadows_are_not_missing(width):
    depth = ground_depth()
    depth[:, 20 : 20 + width] = 0
    assert not len(dropouts(depth))


def test_a_few_rows_of_noise_are_no_panel():
    depth = ground_depth()
    depth[:4, 48:53] = 0
    assert not len(dropouts(depth))
    depth[4, 48:53] = 0
    assert len(dropouts(depth)) == 5 * 3


def test_what_lies_farther_behind_a_gap_is_other_ground():
    depth = ground_depth()
    depth[:, 48:53] = 0
    depth[:, 53:] *= 1.2
    assert not len(dropouts(depth))


def test_rows_between_are_left_out():
    depth = ground_depth()
    depth[:, 48:53] = 0
    searched = dropouts(depth).reshape(-1, 5, 3)[:, 0, 0]
    np.testing.assert_allclose(searched, ground_depth()[::2, 0], rtol=1e-5)


def test_ground_that_falls_away_along_the_ray_is_not_missed():
    depth = ground_depth()
    depth *= np.linspace(2, 1, WIDE.height, dtype=np.float32)[:, None]  # seen at a few degrees
    depth[:, 48:53] = 0
    assert not len(dropouts(depth))
    depth = ground_depth()
    depth *= np.linspace(1.1, 1, WIDE.height, dtype=np.float32)[:, None]  # seen less obliquely
    depth[:, 48:53] = 0
    assert len(dropouts(depth))


def test_a_panel_may_begin_nearer_than_the_camera_sees_ground():
    depth = ground_depth()
    depth[:, 48:53] = 0
    points = all_dropouts(depth)
    before = points[points[:, 2] > 0.3]
    np.testing.assert_allclose(before[:, 2], 0.6, atol=1e-6)
    reach = np.hypot(*before.T[:2])
    assert NEAR <= reach.min() < NEAR + 0.02
    assert abs(reach.max() - ground_depth()[-2, 0]) < 0.02
    # In the directions of the five columns, without gaps
    assert len(np.unique((before[:, 1] / before[:, 0]).round(4))) == 5
    assert np.diff(np.unique(reach.round(3))).max() < 0.02


def test_a_panel_does_not_begin_before_ground_that_is_seen_below_its_stripe():
    depth = ground_depth()
    depth[:-2, 48:53] = 0
    assert len(dropouts(depth))
    assert len(all_dropouts(depth)) == len(dropouts(depth))


def test_known_ground_is_not_doubted_because_a_panel_may_begin_nearer_than_the_camera_sees():
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.525, 1, 0.01), np.arange(-0.5, 0.5, 0.01)))
    depth = ground_depth()
    depth[:, 48:53] = 0
    ground = Intrinsics.points(WIDE, depth, LEVEL)
    for known in (False, True):
        elevation_map = ElevationMap(PIONEER)
        if known:
            elevation_map.update(np.column_stack([x, y, 0 * x]).astype(np.float32))
        elevation_map.update(ground, dropouts=all_dropouts(depth), camera=LEVEL[:3, 3])
        row = np.column_stack([np.arange(0.55, 0.85, 0.05), np.zeros(6)])
        assert elevation_map.grid.at(elevation_map.dropout, row).any() != known
