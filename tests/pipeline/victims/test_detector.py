"""The detector, by a network whose answer is known."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.victims.detector import VictimDetector
from tests.pipeline.victims.networks import SMALL, bright_spots, darknet_files

WHITE, BLACK = np.full((8, 16, 3), 255, np.uint8), np.zeros((8, 16, 3), np.uint8)
THREE = SMALL.replace("classes=1", "classes=3").replace("filters=6", "filters=8")


def three_classes(biases: list[float]) -> np.ndarray:
    """Weights with which THREE sees a thing in every cell, with these logits of its three classes."""
    return np.concatenate([np.ones(8 + 54), [0, 0, 0, 0, 9, *biases], np.zeros(16)])


def test_a_white_spot_is_found_where_it_is(tmp_path: Path) -> None:
    image = np.zeros((16, 32, 3), np.uint8)
    image[8:12, 16:20] = 255  # cell 4, 2 of 8 × 4 cells of 4 × 4 pixels
    (found,) = VictimDetector.load(*darknet_files(tmp_path, SMALL, bright_spots())).detect(image)
    assert found.box == pytest.approx((18 - 4, 10 - 6, 18 + 4, 10 + 6))
    assert found.confidence == pytest.approx(1, abs=1e-3)


def test_nothing_is_found_in_the_dark(tmp_path: Path) -> None:
    assert VictimDetector.load(*darknet_files(tmp_path, SMALL, bright_spots())).detect(BLACK) == []


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((0, 0, 3), np.uint8), r"at least one pixel.*\(0, 0, 3\)"),
        (np.zeros((8, 16), np.uint8), r"\(8, 16"),
        (np.zeros((8, 16, 1), np.uint8), r"\(8, 16"),
        (np.zeros((8, 16, 3), np.float32), "uint8, not float32"),
    ],
)
def test_images_that_are_none_are_refused(image: np.ndarray, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        VictimDetector.load(*darknet_files(tmp_path)).detect(image)


@pytest.mark.parametrize(
    ("biases", "names", "expected"),
    [
        ([9, -9, -9], "person\nfire extinguisher\ncat\n", {"victim"}),
        ([9, -9, -9], "PERSON\ndog\ncat\n", {"victim"}),
        ([-9, 9, -9], "Person\nFire Extinguisher\ncat\n", {"fire_extinguisher"}),
        ([9, 9, 9], "person\nfire extinguisher\ncat\n", {"victim", "fire_extinguisher"}),
        ([-9, -9, 9], "person\nfire extinguisher\ncat\n", set()),
        ([-9, -9, 9], "person\ncat\ndoll", {"victim"}),
    ],
)
def test_classes_are_known_by_their_names(biases: list[float], names: str, expected: set, tmp_path: Path) -> None:
    files = darknet_files(tmp_path, THREE, three_classes(biases))
    files[0].with_suffix(".names").write_text(names)
    found = VictimDetector.load(*files).detect(BLACK)
    assert {thing.kind for thing in found} == expected
    assert [t.confidence for t in found] == sorted((t.confidence for t in found), reverse=True)


@pytest.mark.parametrize(
    ("names", "message"), [("person\ncat", "2 names"), ("a\nb\nc", "victim"), (None, "3 classes")]
)
def test_names_must_fit_and_be_known(names: str | None, message: str, tmp_path: Path) -> None:
    files = darknet_files(tmp_path, THREE, three_classes([0, 0, 0]))
    if names:
        files[0].with_suffix(".names").write_text(names)
    with pytest.raises(InputError, match=message):
        VictimDetector.load(*files)


@pytest.mark.parametrize(("classes", "person"), [(80, 0), (20, 14)])
def test_it_says_whose_classes_it_takes_unnamed_ones_for(classes: int, person: int, tmp_path: Path, capsys) -> None:
    text = SMALL.replace("classes=1", f"classes={classes}").replace("filters=6", f"filters={5 + classes}")
    biases = np.where(np.arange(classes) == person, 9, -9)
    numbers = np.concatenate([np.ones(8 + 54), [0, 0, 0, 0, 9, *biases], np.zeros(2 * (5 + classes))])
    files = darknet_files(tmp_path, text, numbers)
    detector = VictimDetector.load(*files)
    assert str(files[0]) in capsys.readouterr().err
    assert {thing.kind for thing in detector.detect(WHITE)} == {"victim"}


@pytest.mark.parametrize(
    "names", [("a.safetensors", "a.cfg"), ("a.cfg",), ("a.cfg", "a.safetensors"), ("a.weights",)]
)
def test_only_files_that_belong_together_make_a_detector(names: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match="--detector a"):
        VictimDetector.load(*map(Path, names))
