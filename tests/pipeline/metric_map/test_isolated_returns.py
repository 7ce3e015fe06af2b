"""Returns that stand alone in a depth image."""

import numpy as np
import pytest

from pipeline.metric_map.isolated_returns import remove_isolated_returns
from pipeline.metric_map.isolated_returns_kernels import remove_isolated_returns as kernel
from tests.pipeline.still_robot import StillRobot

SHARE = np.float32(0.05)


def test_a_return_needs_two_like_it_near() -> None:
    depth = np.zeros((9, 30), np.float32)
    depth[4, 2] = depth[4, 4] = 1.0  # Two alone
    depth[4, 10] = depth[3, 11] = depth[5, 12] = 2.0  # Three, each within two pixels of both others
    depth[4, 20:23] = 1.0, 1.04, 1.2  # One that is farther
    depth[0, 27:30] = 3.0  # In a corner
    expected = np.zeros_like(depth)
    expected[4, 10] = expected[3, 11] = expected[5, 12] = 2.0
    expected[0, 27:30] = 3.0
    np.testing.assert_array_equal(kernel(depth, 2, SHARE, 2), expected)


def test_a_surface_seen_at_a_grazing_angle_stays_whole() -> None:
    rows = np.arange(250, 480)
    floor = np.repeat((0.65 * 525 / (rows - 239.5)).astype(np.float32)[:, None], 40, axis=1)
    np.testing.assert_array_equal(kernel(floor, 2, SHARE, 2), floor)


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf])
def test_pixels_without_a_return_confirm_nothing(nothing: float) -> None:
    depth = np.full((5, 5), nothing, np.float32)
    depth[2, 2] = 1.0
    assert not kernel(depth, 2, SHARE, 2).any()


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf])
def test_returns_make_no_return_of_a_pixel_without_one(nothing: float) -> None:
    depth = np.ones((5, 5), np.float32)
    depth[2, 2] = nothing
    expected = np.ones_like(depth)
    expected[2, 2] = 0
    np.testing.assert_array_equal(kernel(depth, 2, SHARE, 2), expected)


def test_dust_leaves_surfaces_and_loses_its_specks() -> None:
    """The fractions in the module's docstring: four fifths of a wall are hidden, and 2% of the image are specks."""
    rng = np.random.default_rng(0)
    wall = np.where(rng.random((480, 640)) < 0.2, rng.normal(3.0, 0.015, (480, 640)), 0.0)
    specks = rng.random((480, 640)) < 0.02
    depth = np.where(specks, rng.uniform(0.8, 2.8, (480, 640)), wall).astype(np.float32)
    kept = kernel(depth, 2, SHARE, 2) > 0
    assert kept[~specks & (wall > 0)].mean() > 0.9
    assert kept[specks].mean() < 2e-3


def test_a_frame_keeps_all_but_its_specks() -> None:
    frame = StillRobot().sense()
    cleaned = remove_isolated_returns(frame)
    assert cleaned.returns.sum() >= 0.999 * frame.returns.sum()
    np.testing.assert_array_equal(cleaned.depth[cleaned.returns], frame.depth[cleaned.returns])
    assert cleaned.rgb is frame.rgb
