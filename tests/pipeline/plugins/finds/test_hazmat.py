"""Hazmat signs in images, by the shipped classifier."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.plugins.finds.config import SquaresConfig
from pipeline.plugins.finds.hazmat import HazmatReader
from pipeline.plugins.finds.patch_network import PatchNetwork
from pipeline.plugins.finds.squares import Pyramid, SquareCandidates, rectified
from sarsim.arenas.things.hazmat import sign_face
from sarsim.assets import asset

WEIGHTS = asset("weights", "hazmat.safetensors")
WALL = (140, 120, 90)


@pytest.fixture(scope="module")
def reader() -> HazmatReader:
    return HazmatReader.load(WEIGHTS)


def squares_of(image: np.ndarray) -> SquareCandidates:
    return SquareCandidates.of(image, SquaresConfig())


def wall_with(*signs: tuple[str, tuple[float, float], float, float]) -> np.ndarray:
    """A wall, 320 × 240 pixels, with signs: class, middle, side in pixels, turn in degrees."""
    image = np.full((240, 320, 3), WALL, np.uint8)
    image += np.random.default_rng(0).integers(0, 12, image.shape, np.uint8)
    for name, middle, side, turn in signs:
        face = sign_face(name, 256)
        M = cv2.getRotationMatrix2D((128, 128), turn, side / 256)
        M[:, 2] += np.array(middle) - 128
        size = image.shape[1::-1]
        inside = cv2.warpAffine(np.full((256, 256), 255, np.uint8), M, size, flags=cv2.INTER_AREA)[..., None] / 255
        drawn = cv2.warpAffine(cv2.GaussianBlur(face, (0, 0), 128 / side), M, size, flags=cv2.INTER_LINEAR)
        image = np.asarray(image * (1 - inside) + drawn * inside, np.uint8)
    return image


@pytest.mark.parametrize("turn", [45, 10, 225])
def test_a_sign_is_read_any_way_up(reader: HazmatReader, turn: float) -> None:
    (sign,) = reader.read(squares_of(wall_with(("radioactive", (160, 120), 90, turn))))
    assert (sign.kind, sign.text) == ("hazmat_sign", "radioactive")
    np.testing.assert_allclose(sign.corners.mean(axis=0), (160, 120), atol=3)


def test_two_alike_side_by_side_are_two(reader: HazmatReader) -> None:
    wall = wall_with(("corrosive", (110, 120), 80, 0), ("corrosive", (190, 120), 80, 0))
    signs = reader.read(squares_of(wall))
    assert [sign.text for sign in signs] == ["corrosive"] * 2


def test_a_wall_and_coloured_squares_are_no_signs(reader: HazmatReader) -> None:
    image = wall_with()
    cv2.rectangle(image, (60, 60), (130, 130), (200, 30, 30), -1)
    cv2.rectangle(image, (180, 60), (260, 140), (250, 250, 250), -1)
    assert reader.read(squares_of(image)) == []


def test_a_grey_image_is_searched_and_an_empty_one_refused(reader: HazmatReader) -> None:
    assert isinstance(reader.read(squares_of(wall_with()[..., 0])), list)
    with pytest.raises(InputError, match="an image must be a non-empty uint8 array"):
        reader.read(squares_of(np.zeros((0, 10, 3), np.uint8)))


def test_squares_are_found_once_and_rectified() -> None:
    image = wall_with()
    square = np.array([[100, 60], [190, 80], [180, 170], [90, 150]], np.int32)
    cv2.fillConvexPoly(image, square, (30, 60, 220))
    large = [q for q in squares_of(image).quads if 5000 < cv2.contourArea(q) < 20000]
    (quad,) = (q for q in large if np.abs(q.mean(axis=0) - square.mean(axis=0)).max() < 5)
    assert max(np.abs(quad - corner).sum(axis=1).min() for corner in square) < 6
    patch = rectified(Pyramid(image), quad)
    inner = slice(9, 55)  # of 64, without a tenth at each side
    assert (patch[inner, inner, 2] > 200).all()
    assert (patch[:3, :, 2] < 200).all()


def test_weights_of_something_else_are_refused(tmp_path: Path) -> None:
    for content in (None, b"", WEIGHTS.read_bytes()[:-100]):
        file = tmp_path / "other.safetensors"
        if content is not None:
            file.write_bytes(content)
        with pytest.raises(InputError, match="16 classes"):
            PatchNetwork.load(file, 16)
    with pytest.raises(InputError, match="16 classes"):
        PatchNetwork.load(asset("weights", "pointnet.safetensors"), 16)
