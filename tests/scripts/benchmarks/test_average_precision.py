"""Average precision, by hand."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scripts.benchmarks.average_precision import AveragePrecision, match

Box = Sequence[float]
A, B, C = [0, 0, 10, 10], [20, 0, 30, 10], [40, 0, 50, 10]
NONE = np.zeros((0, 4))


def precision_of(*images: tuple[Sequence[Box], Sequence[float], Sequence[Box], Sequence[bool]]) -> float:
    """Of images: boxes, scores, truths, which of them are ignored."""
    result = AveragePrecision()
    for boxes, scores, truths, ignored in images:
        arrays = (np.array(rows, float).reshape(-1, 4) for rows in (boxes, truths))
        found, present = arrays
        result.add(found, np.array(scores), present, np.array(ignored, bool))
    return result.value


def test_all_found_is_one() -> None:
    assert precision_of(([A, B], [0.9, 0.8], [B, A], [False, False])) == 1.0


def test_nothing_found_is_nothing() -> None:
    assert precision_of(([], [], [A], [False])) == 0.0
    assert precision_of(([B], [0.9], [A], [False])) == 0.0
    assert np.isnan(precision_of(([A], [0.9], [], [])))


def test_a_wrong_one_between_two_right_ones() -> None:
    """Precision 1, 1/2, 2/3 at recall 1/2, 1/2, 1: area 1/2 + 2/3 · 1/2."""
    assert precision_of(([A, C, B], [0.9, 0.8, 0.7], [A, B], [False] * 2)) == pytest.approx(5 / 6)


def test_a_wrong_one_before_all_counts_at_every_recall() -> None:
    """1/2 and 2/3: precision is made to fall, so 2/3 everywhere."""
    assert precision_of(([C, A, B], [0.9, 0.8, 0.7], [A, B], [False] * 2)) == pytest.approx(2 / 3)


def test_a_second_box_for_the_same_person_is_wrong() -> None:
    first, again = precision_of(([A, A], [0.9, 0.8], [A, B], [False] * 2)), 0.5
    assert first == again
    assert precision_of(([A, A, B], [0.9, 0.8, 0.7], [A, B], [False] * 2)) == pytest.approx(5 / 6)


def test_images_are_ranked_together() -> None:
    images = (([A], [0.6], [A], [False]), ([C], [0.9], [A], [False]))
    assert precision_of(*images) == pytest.approx(0.5 / 2)


def test_an_ignored_person_is_neither_right_nor_wrong() -> None:
    assert precision_of(([A, B, B], [0.5, 0.9, 0.8], [A, B], [False, True])) == 1.0
    assert precision_of(([], [], [A, B], [True, False])) == 0.0


def test_less_than_half_an_overlap_is_wrong() -> None:
    assert precision_of(([[0, 0, 10, 4.9]], [0.9], [A], [False])) == 0.0
    assert precision_of(([[0, 0, 10, 5.0]], [0.9], [A], [False])) == 1.0


def test_each_detection_takes_the_best_that_is_left() -> None:
    overlap = np.array([[0.6, 0.9, 0.0], [0.7, 0.8, 0.0], [0.4, 0.9, 0.7]])
    assert match(overlap, np.array([False] * 3), 0.5).tolist() == [1, 0, 2]
    assert match(overlap, np.array([False, True, False]), 0.5).tolist() == [0, 1, 2]


@given(seed=st.integers(0, 999), count=st.integers(1, 8))
def test_detections_that_are_sure_only_of_what_is_right_lose_nothing(seed: int, count: int) -> None:
    """Any number of wrong detections, if all are less confident than the right ones."""
    rng = np.random.default_rng(seed)
    corner = np.arange(count) * 20.0
    right = np.stack([corner, 0 * corner, corner + 10, 0 * corner + 10], axis=1)
    result = AveragePrecision()
    scores = np.concatenate([rng.uniform(0.6, 1, count), rng.uniform(0, 0.5, count)])
    result.add(np.concatenate([right, right + 500]), scores, right, np.zeros(count, bool))
    assert result.value == pytest.approx(1.0)
