import numpy as np
import pytest

from pipeline.sensor import XTION


def test_noise_grows_as_nguyen_izadi_and_lovell_measured():
    assert [XTION.sigma(z) for z in (0.4, 1.4, 2.4)] == pytest.approx([0.0012, 0.0031, 0.0088])
    depth = np.linspace(XTION.nearest, XTION.farthest, 9, dtype=np.float32)
    assert (np.diff(XTION.sigma(depth)) > 0).all()
    assert XTION.sigma(depth).dtype == np.float32


def test_returns_inside_of_the_margin_are_not_cut_off_by_the_end_of_the_range():
    assert XTION.margin == pytest.approx(5 * XTION.sigma(XTION.farthest), rel=0.03)
