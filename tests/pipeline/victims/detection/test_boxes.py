"""Boxes: decoding and overlap by hand, suppression by its properties, and OpenCV's."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.victims.detection.boxes import decode, overlaps, suppress
from pipeline.victims.detection.darknet_cfg import Yolo
from pipeline.victims.detection.letterbox import GREY, Letterbox


def random_boxes(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    low = rng.integers(0, 60, (count, 2))
    return np.concatenate([low, low + rng.integers(1, 40, (count, 2))], axis=1).astype(float), rng.random(
        count
    )


def test_a_cell_is_decoded_by_hand() -> None:
    yolo = Yolo(((10, 20), (30, 40)), (1,), classes=2)
    head = np.full((7, 3, 4), -9, np.float32)
    head[:, 1, 2] = np.log([1, 1, 2, 1, 3, 1, 1 / 3])  # σ = ½ ½, twice as wide, ¾, ½, ¼
    boxes, scores = decode(head, yolo, width=40, height=60, threshold=0.5)
    np.testing.assert_allclose(boxes, [[25 - 30, 30 - 20, 25 + 30, 30 + 20]], rtol=1e-6)  # cells of 10 × 20
    np.testing.assert_allclose(scores, [[0.375, 0.1875]], rtol=1e-6)


def test_what_is_far_out_stays_finite() -> None:
    head = np.full((6, 1, 1), 1e4, np.float32)
    boxes, scores = decode(head, Yolo(((10.0, 20.0),), (0,), 1), 40, 60, 0.5)
    assert np.isfinite(boxes).all()
    assert scores.tolist() == [[1.0]]


def test_overlap_by_hand() -> None:
    a = np.array([[0, 0, 2, 2], [5, 5, 5, 9]], float)
    b = np.array([[1, 1, 3, 3], [0, 0, 2, 2], [5, 5, 5, 9]], float)
    np.testing.assert_allclose(overlaps(a, b), np.array([[1 / 7, 1, 0], [0, 0, 0]]))


@given(count=st.integers(0, 12), seed=st.integers(0, 999), overlap=st.sampled_from([0.2, 0.45, 0.7]))
def test_one_box_is_left_for_each_thing(count: int, seed: int, overlap: float) -> None:
    boxes, scores = random_boxes(count, seed)
    kept = suppress(boxes, scores, overlap)
    between = overlaps(boxes[kept], boxes[kept]) - np.eye(len(kept))
    assert (between <= overlap).all()
    for dropped in set(range(count)) - set(kept.tolist()):
        over = overlaps(boxes[[dropped]], boxes[kept])[0] > overlap
        assert scores[kept][over].max() >= scores[dropped]
    theirs = cv2.dnn.NMSBoxes(
        np.concatenate([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], axis=1).tolist(),
        scores.tolist(),
        0,
        overlap,
    )
    assert sorted(kept.tolist()) == sorted(np.array(theirs).flatten().tolist())


@pytest.mark.parametrize(
    ("size", "corner"), [((640, 480), (0, 0)), ((640, 240), (0, 96)), ((100, 480), (216, 0))]
)
def test_a_box_comes_back_from_the_letterbox(size: tuple[int, int], corner: tuple[int, int]) -> None:
    columns, rows = size
    letterbox, image = Letterbox.fit(np.full((rows, columns, 3), 200, np.uint8), 512, 384)
    assert image.shape == (384, 512, 3)
    assert letterbox.corner == corner
    inside = image == 200
    assert ((image == GREY) | inside).all()
    y, x = np.nonzero(inside[..., 0])
    box = np.array([[x.min(), y.min(), x.max() + 1, y.max() + 1]], float)
    np.testing.assert_allclose(letterbox.to_image(box), [[0, 0, columns, rows]], atol=1e-4)
    np.testing.assert_array_equal(
        letterbox.to_image(box + np.array([-99, -99, 99, 99])), [[0, 0, columns, rows]]
    )
