import numpy as np
import pytest

from pipeline.lettering import IN_MIDDLE, ON_LINE, width_of, write

COLOUR = (10, 200, 30)


def written(text, is_smooth=True, anchor=ON_LINE, at=(20, 60)):
    image = np.zeros((100, 200, 3), np.uint8)
    write(image, at, text, 30, COLOUR, anchor, is_smooth)
    return image


def inked(image):
    """Lowest and highest row and column that the text touches."""
    rows, columns = np.nonzero(image.any(axis=2))
    return rows.min(), rows.max(), columns.min(), columns.max()


def test_text_stands_on_its_line_and_is_as_wide_as_announced():
    top, bottom, left, right = inked(written("HEH"))
    assert bottom == pytest.approx(59, abs=1) and bottom - top == pytest.approx(0.7 * 30, abs=2)
    assert left >= 20 and right <= 20 + width_of("HEH", 30)


def test_text_can_be_centred():
    top, bottom, left, right = inked(written("HEH", anchor=IN_MIDDLE, at=(100, 50)))
    assert (top + bottom) / 2 == pytest.approx(50, abs=3) and (left + right) / 2 == pytest.approx(100, abs=2)


def test_text_that_is_not_smooth_has_its_colour_alone():
    colours = np.unique(written("sarsim", is_smooth=False).reshape(-1, 3), axis=0)
    assert colours.tolist() == [[0, 0, 0], list(COLOUR)]
    assert len(np.unique(written("sarsim").reshape(-1, 3), axis=0)) > 2


@pytest.mark.parametrize("text", ["", "two\nlines", "far too long for the image " * 5, "日本"])
def test_any_text_can_be_written(text):
    assert written(text).shape == (100, 200, 3)
    assert width_of(text, 30) >= 0


@pytest.mark.parametrize(("text", "same"), [("Işıkdemir", "Isikdemir"), ("2 × 3 m²", "2 x 3 m2"), ("−1", "-1")])
def test_characters_that_the_typeface_lacks_become_similar_ones(text, same):
    np.testing.assert_array_equal(written(text), written(same))
