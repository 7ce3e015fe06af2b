import numpy as np
import pytest

from pipeline.elevation_map.ground_evidence import find_depth_dropouts
from pipeline.frame import Intrinsics
from pipeline.sensor import XTION

WIDE = Intrinsics(width=101, height=8, fx=100.0, fy=100.0, cx=50.5, cy=-58.0)
"""A camera of which every row shows the ground when it looks level."""
LEVEL = np.array([(0.0, 0, 1, 0), (-1, 0, 0, 0), (0, -1, 0, 0.6), (0, 0, 0, 1)])
"""A camera 0.6 m above the origin that looks along x."""


def ground_depth() -> np.ndarray:
    """What the camera sees of level ground: the same depth along each row."""
    rows = np.arange(WIDE.height) + 0.5
    return np.repeat((0.6 * WIDE.fy / (rows - WIDE.cy)).astype(np.float32)[:, None], WIDE.width, axis=1)


def dropouts(depth):
    return find_depth_dropouts(depth, WIDE, LEVEL, XTION)


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
