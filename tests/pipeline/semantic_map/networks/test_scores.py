"""Intersection over union, by hand."""

import numpy as np
import pytest

from pipeline.semantic_map.networks.scores import confusion_of, iou, mean_iou


def test_iou_counts_returns_not_voxels() -> None:
    counts = np.zeros((3, 6), int)
    counts[0, 0], counts[1, 0], counts[1, 1], counts[2, 1] = 6, 2, 1, 3
    confusion = confusion_of(counts, np.array([0, 1, 1]))
    assert confusion[:2, :2].tolist() == [[6, 2], [0, 4]]
    assert iou(confusion)[:2] == pytest.approx([6 / 8, 4 / 6])
    assert np.isnan(iou(confusion)[2:]).all()
    assert mean_iou(confusion, range(4)) == pytest.approx((6 / 8 + 4 / 6) / 2)
    assert np.isnan(mean_iou(confusion, [3]))


def test_a_class_that_is_only_given_has_no_share_in_the_mean() -> None:
    confusion = confusion_of(np.array([[4, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]]), np.array([0, 3]))
    assert iou(confusion)[3] == 0
    assert mean_iou(confusion, range(4)) == pytest.approx(4 / 5)
