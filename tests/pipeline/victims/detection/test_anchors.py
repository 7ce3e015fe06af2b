"""Anchors fitted to sizes."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.victims.detection.anchors import fit_anchors, size_overlaps


def test_size_overlap_by_hand() -> None:
    result = size_overlaps(np.array([[2.0, 4.0]]), np.array([[2.0, 4.0], [4.0, 2.0], [1.0, 1.0]]))
    np.testing.assert_allclose(result, [[1, 4 / 12, 1 / 8]])


def test_clusters_are_found_and_sorted() -> None:
    rng = np.random.default_rng(0)
    middles = np.array([[80.0, 60.0], [10.0, 20.0], [30.0, 15.0]])
    sizes = np.concatenate([m * rng.uniform(0.95, 1.05, (50, 2)) for m in middles])
    anchors = fit_anchors(sizes, 3, np.random.default_rng(1))
    np.testing.assert_allclose(anchors, middles[[1, 2, 0]], rtol=0.03)


def test_fitted_anchors_overlap_more_than_those_of_coco() -> None:
    rng = np.random.default_rng(0)
    sizes = np.exp(rng.normal([4.5, 4.3], 0.8, (400, 2)))
    coco = np.array([(10, 14), (23, 27), (37, 58), (81, 82), (135, 169), (344, 319)], float)
    fitted = fit_anchors(sizes, 6, np.random.default_rng(0))
    means = [size_overlaps(sizes, anchors).max(axis=1).mean() for anchors in (fitted, coco)]
    assert means[0] > means[1] + 0.05


def test_the_same_seed_gives_the_same_anchors() -> None:
    sizes = np.random.default_rng(0).uniform(5, 90, (60, 2))
    first, again = (fit_anchors(sizes, 5, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_too_few_sizes_are_refused() -> None:
    with pytest.raises(InputError, match="1 boxes of different size: too few to fit 2"):
        fit_anchors(np.array([[4.0, 6.0], [4.0, 6.0]]), 2, np.random.default_rng(0))
