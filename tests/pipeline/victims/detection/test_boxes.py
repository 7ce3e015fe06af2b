"""Boxes: decoding and overlap by hand, suppression by its properties and OpenCV's."""

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.victims.detection.boxes import decode, overlaps, size_overlaps, suppress
from pipeline.victims.detection.yolo import Grid


def random_boxes(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    low = rng.integers(0, 60, (count, 2))
    return np.concatenate([low, low + rng.integers(1, 40, (count, 2))], axis=1).astype(float), rng.random(count)


def test_a_cell_is_decoded_by_hand() -> None:
    yolo = Grid(((10, 20), (30, 40)), (1,))
    head = np.full((7, 3, 4), -9, np.float32)
    head[:, 1, 2] = np.log([1, 1, 2, 1, 3, 1, 1 / 3])  # σ = ½ ½, twice as wide, ¾, ½, ¼
    boxes, scores = decode(head, yolo, width=40, height=60, threshold=0.5)
    np.testing.assert_allclose(boxes, [[25 - 30, 30 - 20, 25 + 30, 30 + 20]], rtol=1e-6)  # cells of 10 × 20
    np.testing.assert_allclose(scores, [[0.375, 0.1875]], rtol=1e-6)


def test_what_is_far_out_stays_finite() -> None:
    head = np.full((6, 1, 1), 1e4, np.float32)
    boxes, scores = decode(head, Grid(((10.0, 20.0),), (0,)), 40, 60, 0.5)
    assert np.isfinite(boxes).all()
    assert scores.tolist() == [[1.0]]


def test_overlap_by_hand() -> None:
    a = np.array([[0, 0, 2, 2], [5, 5, 5, 9]], float)
    b = np.array([[1, 1, 3, 3], [0, 0, 2, 2], [5, 5, 5, 9]], float)
    np.testing.assert_allclose(overlaps(a, b), np.array([[1 / 7, 1, 0], [0, 0, 0]]))


@given(count=st.integers(0, 12), seed=st.integers(0, 999), overlap=st.sampled_from([0.2, 0.45, 0.7]))
def test_one_box_is_left_for_each_thing(count: int, seed: int, overlap: float) -> None:
    boxes, scores = random_boxes(count, seed)
    kept = suppress(boxes, scores, overlap, 3000)
    between = overlaps(boxes[kept], boxes[kept]) - np.eye(len(kept))
    assert (between <= overlap).all()
    for dropped in set(range(count)) - set(kept.tolist()):
        over = overlaps(boxes[[dropped]], boxes[kept])[0] > overlap
        assert scores[kept][over].max() >= scores[dropped]
    theirs = cv2.dnn.NMSBoxes(
        np.concatenate([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], axis=1).tolist(), scores.tolist(), 0, overlap
    )
    assert sorted(kept.tolist()) == sorted(np.array(theirs).flatten().tolist())


def test_size_overlap_by_hand() -> None:
    result = size_overlaps(np.array([[2.0, 4.0]]), np.array([[2.0, 4.0], [4.0, 2.0], [1.0, 1.0]]))
    np.testing.assert_allclose(result, [[1, 4 / 12, 1 / 8]])
