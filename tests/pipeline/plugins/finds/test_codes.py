"""QR codes and AprilTags in images of every kind, and what hostile codes come to."""

import cv2
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.plugins.finds.codes import CodeReader
from pipeline.plugins.finds.config import SquaresConfig
from pipeline.plugins.finds.squares import SquareCandidates
from pipeline.tracks.find import Reading, plain_text
from sarsim.arenas.things.codes import qr_picture, tag_picture

READER = CodeReader()


def read(image: np.ndarray) -> list[Reading]:
    return READER.read(SquareCandidates.of(image, SquaresConfig()))


def photo(code: np.ndarray, side: int, turn: float = 0.0, at: tuple[int, int] = (200, 150)) -> np.ndarray:
    """A grey wall, 400 × 300 pixels, with a code of ``side`` pixels in its middle, turned by degrees."""
    image = np.full((300, 400, 3), 150, np.uint8)
    M = cv2.getRotationMatrix2D((code.shape[1] / 2, code.shape[0] / 2), turn, side / len(code))
    M[:, 2] += np.array(at) - np.array(code.shape[::-1]) / 2
    soft = cv2.GaussianBlur(code, (0, 0), max(0.1, len(code) / side / 2))
    warped = cv2.warpAffine(soft, M, (400, 300), flags=cv2.INTER_LINEAR, borderValue=150)
    image[:] = warped[..., None]
    return image


@pytest.mark.parametrize("turn", [0, 30, 180])
def test_small_codes_are_read_any_way_up(turn):
    (code,) = read(photo(qr_picture("victim 3"), 100, turn))
    assert (code.kind, code.text, code.confidence) == ("qr_code", "victim 3", 1.0)
    (tag,) = read(photo(tag_picture(17), 60, turn))
    assert (tag.kind, tag.text) == ("april_tag", "17")
    np.testing.assert_allclose(tag.corners.mean(axis=0), (200, 150), atol=1)


def aslant(code: np.ndarray, width: int, height: int) -> np.ndarray:
    """A grey wall, 640 × 480 pixels, with a code seen from the side: its left edge is nearer than its right one."""
    less = height / 16
    quad = np.array([[0, -less], [width, less], [width, height - less], [0, height + less]], np.float32)
    n = len(code)
    face = np.array([[0, 0], [n, 0], [n, n], [0, n]], np.float32)
    T = cv2.getPerspectiveTransform(face, quad + np.float32([250, 200]))
    soft = cv2.GaussianBlur(code, (0, 0), n / width / 2)
    warped = cv2.warpPerspective(soft, T, (640, 480), flags=cv2.INTER_LINEAR, borderValue=150)
    return np.repeat(warped[..., None], 3, axis=2)


@pytest.mark.parametrize(("width", "height"), [(50, 100), (60, 60)])
def test_a_code_is_read_from_the_side_and_with_two_pixels_a_module(width, height):
    (code,) = read(aslant(qr_picture("victim 3"), width, height))
    assert code.text == "victim 3"
    np.testing.assert_allclose(code.corners.mean(axis=0), (250 + width / 2, 200 + height / 2), atol=5)


def test_a_blank_square_is_no_code():
    image = np.full((300, 400, 3), 150, np.uint8)
    cv2.rectangle(image, (100, 100), (180, 180), (250, 250, 250), -1)
    assert len(SquareCandidates.of(image, SquaresConfig()).quads)
    assert read(image) == []


def test_a_grey_image_and_a_huge_one_are_read_as_well():
    image = photo(qr_picture("exit"), 120)
    assert [r.text for r in read(image[..., 0])] == ["exit"]
    huge = cv2.resize(image, (8000, 6000), interpolation=cv2.INTER_NEAREST)
    (code,) = read(huge)
    assert code.text == "exit"
    np.testing.assert_allclose(code.corners.mean(axis=0), (4000, 3000), atol=30)


@pytest.mark.parametrize("image", [np.zeros((0, 5, 3), np.uint8), np.zeros((5, 5, 4), np.uint8), np.zeros((5, 5, 3))])
def test_other_images_are_refused(image):
    with pytest.raises(InputError, match="an image must be a non-empty uint8 array"):
        read(image)


def test_two_alike_side_by_side_are_two():
    tag, image = tag_picture(5), photo(tag_picture(5), 60, at=(140, 150))
    other = photo(tag, 60, at=(240, 150))
    image[:, 200:] = other[:, 200:]
    assert [r.text for r in read(image)] == ["5", "5"]


def test_what_a_code_says_is_cut_and_made_printable_for_maps():
    assert plain_text("<script>\x1b[2J\n") == "<script>\ufffd[2J\ufffd"
    assert plain_text("a" * 1_000_000) == "a" * 39 + "…"
    assert plain_text("a" * 40) == "a" * 40


def test_a_script_is_read_as_text():
    text = "<script>alert(1)</script>"
    assert [r.text for r in read(photo(qr_picture(text), 200))] == [text]
