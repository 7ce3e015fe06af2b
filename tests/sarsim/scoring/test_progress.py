"""Times and areas of an exploration, worked out by hand."""

import numpy as np
import pytest

from sarsim.scoring.progress import ExploredCurve, fractions_at, mean_up_to, progress_figures

CURVE = ExploredCurve(np.array([0.0, 10.0, 30.0]), np.array([0.0, 4.0, 9.0]), np.array([0.2, 0.5, 0.95]))


def test_a_share_holds_until_the_next() -> None:
    figures = progress_figures(CURVE, (40.0, 10.0))
    assert figures == pytest.approx(
        {"t90_s": 30.0, "auc_time": 0.2 * 10 + 0.5 * 20 + 0.95 * 10, "auc_way": 0.2 * 4 + 0.5 * 5 + 0.95 * 1}
    )


def test_a_share_is_that_of_the_last_place_and_none_before_the_first() -> None:
    turned = np.array([1.0, 4.0, 4.0])  # two looks from one place
    assert fractions_at(np.array([0.0, 1.0, 3.9, 4.0, 99.0]), turned, CURVE.explored).tolist() == [
        0,
        0.2,
        0.2,
        0.95,
        0.95,
    ]


def test_the_mean_up_to_a_horizon_is_that_of_an_exploration_that_waits_there() -> None:
    ended = progress_figures(CURVE, (40.0, 10.0)) | {"explored_fraction": 0.95}
    waited = progress_figures(CURVE, (100.0, 10.0))
    arrays = {key: np.array(value) for key, value in ended.items()}
    mean = mean_up_to(np.array(100.0), np.array(40.0), arrays, "time")
    assert mean == pytest.approx(waited["auc_time"] / 100)
