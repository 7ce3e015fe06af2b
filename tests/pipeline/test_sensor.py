import numpy as np
import pytest

from pipeline.sensor import XTION


def test_noise_grows_as_nguyen_izadi_and_lovell_measured():
    assert [XTION.sigma(z) for z in (0.4, 1.4, 2.4)] == pytest.approx([0.0012, 0.0031, 0.0088])
    depth = np.linspace(XTION.nearest, XTION.farthest, 9, dtype=np.float32)
    assert (np.diff(XTION.sigma(depth)) > 0).all()
    assert XTION.sigma(depth).dtype == np.float32
