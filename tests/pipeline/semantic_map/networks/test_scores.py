"""Intersection over union, by hand."""

import numpy as np
import pytest

from pipeline.semantic_map.networks.scores import Confusion


def test_iou_counts_returns_not_voxels() -> None:
    counts = np.zeros((3, 6), int)
    counts[0, 0], counts[1, 0], counts[1, 1], counts[2, 1] = 6, 2, 1, 3
    confusion = Confusion.of(counts, np.array([0, 1, 1]))
    assert confusion.counts[:2, :2].tolist() == [[6, 2], [0, 4]]
    assert confusion.iou[:2] == pytest.approx([6 / 8, 4 / 6])
    assert np.isnan(confusion.iou[2:]).all()
    assert confusion.miou_four == pytest.approx((6 / 8 + 4 / 6) / 2)


def test_a_class_that_is_only_given_has_no_share_in_the_mean() -> None:
    confusion = Confusion.of(np.array([[4, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]]), np.array([0, 3]))
    assert confusion.iou[3] == 0
    assert confusion.miou_four == pytest.approx(4 / 5)


def test_confusions_add_up() -> None:
    one = Confusion.of(np.eye(6, dtype=int), np.arange(6))
    assert ((one + one).counts == 2 * np.eye(6)).all()
