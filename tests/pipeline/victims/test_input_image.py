"""Light evened out, and images fitted into the input."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.victims.input_image import GREY, Letterbox, evenly_exposed


def test_dim_light_makes_no_difference() -> None:
    rng = np.random.default_rng(0)
    day = rng.integers(80, 130, (48, 64, 3)).repeat(10, axis=0).repeat(10, axis=1).astype(np.uint8)
    dim = (day // 4).astype(np.uint8)
    difference = evenly_exposed(day).astype(int) - evenly_exposed(dim)
    assert np.abs(difference).mean() < 4  # rounded away in the dark


def test_a_dark_half_becomes_as_bright_as_the_other() -> None:
    image = np.full((480, 640, 3), 130, np.uint8)
    image[:, 320:] = 30
    result = evenly_exposed(image).astype(float)
    assert abs(result[:, :100].mean() - 130) < 3
    assert abs(result[:, -100:].mean() - 130) < 10


def test_what_is_lit_well_stays_as_it_is() -> None:
    image = np.random.default_rng(0).integers(140, 256, (48, 64, 3)).astype(np.uint8)
    np.testing.assert_array_equal(evenly_exposed(image), image)


def test_colours_keep_their_proportions() -> None:
    image = np.full((60, 80, 3), (40, 20, 10), np.uint8)
    assert np.abs(evenly_exposed(image) - np.array([1, 0.5, 0.25]) * 130).max() <= 1


def test_what_is_black_stays_black() -> None:
    assert not evenly_exposed(np.zeros((60, 80, 3), np.uint8)).any()
    noise = np.ones((60, 80, 3), np.uint8)
    assert evenly_exposed(noise).max() <= 11  # ceil(130 / 12)


@given(arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40), st.just(3))))
def test_any_image_keeps_its_shape(image: np.ndarray) -> None:
    before = image.copy()
    result = evenly_exposed(image)
    assert result.shape == image.shape
    assert result.dtype == np.uint8
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize(("size", "corner"), [((640, 480), (0, 0)), ((640, 240), (0, 96)), ((100, 480), (216, 0))])
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
    np.testing.assert_array_equal(letterbox.to_image(box + np.array([-99, -99, 99, 99])), [[0, 0, columns, rows]])
