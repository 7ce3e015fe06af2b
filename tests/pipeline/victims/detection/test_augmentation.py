"""Augmentation: boxes stay on what they were drawn around."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.victims.detection.augmentation import CanvasSampler, augmented, cut, mirrored, pasted, recoloured
from pipeline.victims.detection.labelled_image import TrainingImage
from pipeline.victims.detection.training_config import CanvasAugmentation, YoloTrainingConfig
from tests.pipeline.victims.detection.people import WhiteBoxes

USUAL = CanvasAugmentation(variation=1.5, visible=0.3)
PLAIN = CanvasAugmentation(hue=0, variation=1)


def sampler(shown: WhiteBoxes, batch: int, seed: int = 0) -> CanvasSampler:
    """Draws canvases of 64 x 48 pixels, on which images just fit."""
    fitting = CanvasAugmentation(variation=1)
    return CanvasSampler(shown, YoloTrainingConfig(width=64, height=48, batch=batch, seed=seed, augmentation=fitting))


def images(count: int, seed: int) -> list[TrainingImage]:
    source = WhiteBoxes(100, seed)
    return [source[3 * i] for i in range(count)]


@given(seed=st.integers(0, 9999), count=st.sampled_from([1, 4]))
def test_boxes_hold_all_white_and_little_else(seed: int, count: int) -> None:
    canvas = augmented(images(count, seed), [], (96, 64), PLAIN, np.random.default_rng(seed))
    assert canvas.rgb.shape == (64, 96, 3)
    white = canvas.rgb.min(axis=2) > 200
    outside = white.copy()
    for x0, y0, x1, y1 in canvas.boxes:
        rows, columns = slice(int(np.floor(y0)), int(np.ceil(y1))), slice(int(np.floor(x0)), int(np.ceil(x1)))
        outside[rows, columns] = False
        if min(x1 - x0, y1 - y0) > 3:
            inner = white[int(np.ceil(y0)) + 1 : int(y1) - 1, int(np.ceil(x0)) + 1 : int(x1) - 1]
            assert inner.all()
    assert not outside.any()


@given(seed=st.integers(0, 999))
def test_boxes_lie_on_the_canvas(seed: int) -> None:
    canvas = augmented(images(4, seed), images(1, seed + 1), (96, 64), USUAL, np.random.default_rng(seed))
    assert (canvas.boxes >= 0).all()
    assert (canvas.boxes <= [96, 64, 96, 64]).all()
    assert len(canvas.boxes) == len(canvas.ignored)


def test_what_little_is_left_at_an_edge_is_ignored() -> None:
    boxes = np.array([[0, 0, 10, 10], [8, 0, 18, 10], [20, 0, 30, 10]], np.float32)
    image = TrainingImage(np.zeros((10, 30, 3), np.uint8), boxes, np.zeros(3, bool))
    result = cut(image, (0, 0, 10, 10), 0.3)
    np.testing.assert_array_equal(result.boxes, [[0, 0, 10, 10], [8, 0, 10, 10]])
    assert result.ignored.tolist() == [False, True]


def test_a_mirror_twice_changes_nothing() -> None:
    (image,) = images(1, 0)
    once = mirrored(image)
    np.testing.assert_array_equal(once.boxes[0, [0, 2]], 64 - image.boxes[0, [2, 0]])
    np.testing.assert_array_equal(mirrored(once).rgb, image.rgb)
    np.testing.assert_array_equal(mirrored(once).boxes, image.boxes)


def test_colours_change_within_bounds() -> None:
    grey = TrainingImage(np.full((1, 1, 3), 100, np.uint8), np.zeros((0, 4), np.float32), np.zeros(0, bool))
    values = [int(recoloured(grey, USUAL, np.random.default_rng(i)).rgb[0, 0, 0]) for i in range(200)]
    assert 66 <= min(values) < 70
    assert 145 < max(values) <= 150
    (image,) = images(1, 0)
    same = recoloured(image, PLAIN, np.random.default_rng(0)).rgb
    assert np.abs(same.astype(int) - image.rgb).max() <= 4  # of the way to HSV and back


def test_a_canvas_depends_on_its_number_alone() -> None:
    one, other = (sampler(WhiteBoxes(9), 2, 5) for _ in range(2))
    one.batch(0)
    for mine, its in zip(one.batch(3), other.batch(3), strict=True):
        np.testing.assert_array_equal(mine.rgb, its.rgb)
        np.testing.assert_array_equal(mine.boxes, its.boxes)
    assert (one.batch(3)[0].rgb != one.batch(4)[0].rgb).any()


def test_every_second_image_shows_no_people() -> None:
    batch = sampler(WhiteBoxes(30), 600).batch(0)
    # Every second canvas has one image, the others four.
    assert np.mean([len(image.boxes) == 0 for image in batch]) == pytest.approx((0.5 + 0.5**4) / 2, abs=0.05)


def test_images_without_anyone_are_refused() -> None:
    class Empty(WhiteBoxes):
        def __getitem__(self, index: int) -> TrainingImage:
            return super().__getitem__(2)

    with pytest.raises(InputError, match="no training image shows a person"):
        sampler(Empty(3), 2)


def cut_out(seed: int) -> TrainingImage:
    """A person with a known mask of pixels."""
    (image,) = images(1, seed)
    return replace(image, shown=image.rgb.min(axis=2) > 200)


@given(seed=st.integers(0, 999), ratio=st.sampled_from([0.5, 1.0]))
def test_pasted_people_stand_where_their_box_is(seed: int, ratio: float) -> None:
    black = TrainingImage(np.zeros((64, 96, 3), np.uint8), np.zeros((0, 4), np.float32), np.zeros(0, bool))
    result = pasted(black, cut_out(seed), ratio, USUAL, np.random.default_rng(seed))
    y, x = np.nonzero(result.rgb.min(axis=2) > 200)
    np.testing.assert_allclose(result.boxes, [[x.min(), y.min(), x.max() + 1, y.max() + 1]], atol=1)
    assert not result.ignored.any()
    assert not black.rgb.any()


def test_who_is_pasted_over_is_ignored() -> None:
    donor = cut_out(0)
    x0, y0, x1, y1 = donor.boxes[0]
    size = int(x1 - x0), int(y1 - y0)
    boxes = np.array([[0, 0, *size], [0, 0, 4 * size[0], 4 * size[1]]], np.float32)
    canvas = TrainingImage(np.zeros((size[1], size[0], 3), np.uint8), boxes, np.zeros(2, bool))
    result = pasted(canvas, donor, 1.0, USUAL, np.random.default_rng(0))
    assert result.ignored.tolist() == [True, True, False]  # the second one's part on the canvas is all covered
    np.testing.assert_allclose(result.boxes[2], [0, 0, *size])


def test_who_does_not_fit_or_is_not_known_is_not_pasted() -> None:
    (canvas,) = images(1, 3)
    assert pasted(canvas, cut_out(0), 9.0, USUAL, np.random.default_rng(0)) is canvas
    assert pasted(canvas, images(1, 0)[0], 1.0, USUAL, np.random.default_rng(0)) is canvas
