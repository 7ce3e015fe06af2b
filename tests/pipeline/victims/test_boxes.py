"""Boxes: decoding and overlap by hand, suppression by its properties."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.victims.boxes import MAX_BOXES, pairwise_iou, suppress_non_maxima
from pipeline.victims.yolo import decode


def random_boxes(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    low = rng.integers(0, 60, (count, 2))
    return np.concatenate([low, low + rng.integers(1, 40, (count, 2))], axis=1).astype(float), rng.random(count)


def test_a_cell_is_decoded_by_hand() -> None:
    head = np.full((7, 3, 4), -9, np.float32)
    head[:, 1, 2] = np.log([1, 1, 2, 1, 3, 1, 1 / 3])  # σ = ½ ½, twice as wide, ¾, ½, ¼
    boxes, scores = decode(head, ((30, 40),), width=40, height=60, threshold=0.5)
    np.testing.assert_allclose(boxes, [[25 - 30, 30 - 20, 25 + 30, 30 + 20]], rtol=1e-6)  # cells of 10 × 20
    np.testing.assert_allclose(scores, [[0.375, 0.1875]], rtol=1e-6)


def test_what_is_far_out_stays_finite() -> None:
    head = np.full((6, 1, 1), 1e4, np.float32)
    boxes, scores = decode(head, ((10.0, 20.0),), 40, 60, 0.5)
    assert np.isfinite(boxes).all()
    assert scores.tolist() == [[1.0]]


def test_overlap_by_hand() -> None:
    a = np.array([[0, 0, 2, 2], [5, 5, 5, 9]], float)
    b = np.array([[1, 1, 3, 3], [0, 0, 2, 2], [5, 5, 5, 9]], float)
    np.testing.assert_allclose(pairwise_iou(a, b), np.array([[1 / 7, 1, 0], [0, 0, 0]]))


@given(count=st.integers(0, 12), seed=st.integers(0, 999), overlap=st.sampled_from([0.2, 0.45, 0.7]))
def test_one_box_is_left_for_each_thing(count: int, seed: int, overlap: float) -> None:
    boxes, scores = random_boxes(count, seed)
    kept, kept_scores = suppress_non_maxima(boxes, scores, 1e-9, overlap)
    assert (kept_scores[:-1] >= kept_scores[1:]).all()
    between = pairwise_iou(kept, kept) - np.eye(len(kept))
    assert (between <= overlap).all()
    left = [tuple(box) for box in kept]
    for box, score in zip(boxes, scores, strict=True):
        if tuple(box) not in left:
            over = pairwise_iou(box[None], kept)[0] > overlap
            assert kept_scores[over].max() >= score


def test_only_boxes_with_an_area_and_enough_confidence_are_kept() -> None:
    boxes = np.array([[0, 0, 4, 4], [10, 0, 14, 4], [20, 4, 24, 0], [30, 0, 34, 4]], np.float32)
    kept, scores = suppress_non_maxima(boxes, np.array([0.3, 0.5, 0.9, 0.7], np.float32), 0.4, 0.5)
    np.testing.assert_array_equal(kept, boxes[[3, 1]])
    assert scores.tolist() == [np.float32(0.7), 0.5]


def test_only_the_best_of_very_many_boxes_are_compared() -> None:
    left = 2 * np.arange(MAX_BOXES + 1)
    boxes = np.stack([left, 0 * left, left + 1, 0 * left + 1], axis=1).astype(np.float32)
    kept, _ = suppress_non_maxima(boxes, np.linspace(0.2, 0.9, len(boxes), dtype=np.float32), 0.1, 0.5)
    np.testing.assert_array_equal(kept, boxes[:0:-1])
