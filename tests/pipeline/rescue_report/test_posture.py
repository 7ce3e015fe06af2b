"""Sizes of boxes, and what they say of how a person lies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.rescue_report.config import PostureConfig
from pipeline.rescue_report.posture import Posture, posture_of
from tests.pipeline.rescue_report.people import block


@settings(max_examples=25, deadline=None)
@given(st.floats(-np.pi, np.pi), st.floats(-20, 20))
def test_the_size_does_not_depend_on_where_a_person_lies(yaw: float, x: float) -> None:
    posture = posture_of(block((x, 3, 0.5), (1.7, 0.5, 0.3), yaw), PostureConfig())
    assert (posture.length, posture.width, posture.height) == pytest.approx((1.7, 0.5, 0.3), abs=0.05)
    assert posture.name == "lying"


@pytest.mark.parametrize(
    ("size", "name"),
    [((0.7, 0.6, 0.8), "sitting, kneeling or leaning"), ((0.3, 0.2, 0.2), ""), ((1.6, 0.7, 0.9), "")],
)
def test_a_size_determines_a_posture_or_does_not(size: tuple[float, float, float], name: str) -> None:
    assert Posture(*size).name == name


def test_a_single_point_has_no_size() -> None:
    assert posture_of(np.zeros((1, 3), np.float32), PostureConfig()) == Posture(0, 0, 0)
