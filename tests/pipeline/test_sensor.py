import numpy as np
import pytest

from pipeline.sensor import XTION, DepthNoise, SensorModel


def test_noise_grows_as_nguyen_izadi_and_lovell_measured():
    assert [XTION.sigma(z) for z in (0.4, 1.4, 2.4)] == pytest.approx([0.0012, 0.0031, 0.0088])
    depth = np.linspace(XTION.nearest, XTION.farthest, 9, dtype=np.float32)
    assert (np.diff(XTION.sigma(depth)) > 0).all()
    assert XTION.sigma(depth).dtype == np.float32


def test_the_unreliable_bands_follow_from_range_and_noise():
    camera = SensorModel.with_range(0.5, 4.0, DepthNoise(min_sigma=0.001, growth=0.002, best_depth=1.0))
    assert camera.sigma(4.0) == pytest.approx(0.019)
    assert camera.margin == pytest.approx(5 * 0.019)


def test_a_camera_is_precise_as_far_as_its_noise_is_small():
    wide = SensorModel.with_range(0.5, 8.0, DepthNoise(min_sigma=0.002, growth=0.002, best_depth=1.0))
    assert wide.precise.farthest == pytest.approx(4.0)  # 0.002 + 0.002 · 3²
    assert wide.precise.sigma(4.0) == pytest.approx(0.02)
    assert (wide.precise.nearest, wide.precise.noise) == (wide.nearest, wide.noise)
    assert wide.precise.margin == pytest.approx(0.1)
    assert SensorModel.with_range(0.5, 8.0, DepthNoise(0.002, 0.02)).precise.farthest == 3.5
    assert SensorModel.with_range(0.5, 8.0, DepthNoise(0.01, 0.0)).precise.farthest == 8.0
    assert XTION.precise == XTION


def test_returns_outside_the_range_are_none():
    depth = np.array([[0.0, 0.7, 0.8], [2.0, 3.5, 3.6]], np.float32)
    kept = XTION.in_range(depth)
    np.testing.assert_array_equal(kept, np.array([[0, 0, 0.8], [2.0, 3.5, 0]], np.float32))
    assert kept.dtype == np.float32
