"""The detector, by a network whose answer is known."""

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.special import logit

from pipeline.errors import InputError
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detection.detector import VictimDetector, of_both_sizes, turned_back
from pipeline.victims.detection.network import DarknetNetwork
from pipeline.victims.detection.weights import write_weights
from tests.pipeline.victims.detection.networks import SMALL, random_network


def bright_spot_network() -> DarknetNetwork:
    """Sees a person of 4 × 6 pixels wherever its input, 16 × 8, is white."""
    network = random_network(SMALL)
    first, second = network.convolutions
    with torch.no_grad():
        assert first.norm is not None and first.norm.running_mean is not None
        assert first.norm.running_var is not None and second.conv.bias is not None
        first.conv.weight.zero_()
        first.conv.weight[:, :, 1, 1] = 1 / 3
        first.norm.running_mean.zero_(), first.norm.running_var.fill_(1)
        first.norm.weight.fill_(1), first.norm.bias.zero_()
        second.conv.weight.zero_(), second.conv.bias.zero_()
        second.conv.weight[4:, 0] = 20
        second.conv.bias[4:] = -10
    return network


def test_a_white_spot_is_found_where_it_is() -> None:
    image = np.zeros((16, 32, 3), np.uint8)
    image[8:12, 16:20] = 255  # cell 4, 2 of 8 × 4 cells of 4 × 4 pixels
    (found,) = VictimDetector(bright_spot_network(), DetectorConfig(smaller=1.0)).detect(image)
    assert found.box == pytest.approx((18 - 4, 10 - 6, 18 + 4, 10 + 6))
    assert found.confidence == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(("near", "widths"), [(0.4, {16, 32}), (0.6, {16})])
def test_a_smaller_input_finds_those_who_are_larger(near: float, widths: set[int]) -> None:
    image = np.zeros((32, 64, 3), np.uint8)
    image[8:24, 24:40] = 255
    # Boxes have 4 × 6 pixels, of an input of 16 × 8 and of one of 8 × 4, where they are higher than the image.
    config = DetectorConfig(smaller=0.5, large_box=near, suppressing_iou=0.99)
    found = VictimDetector(bright_spot_network(), config).detect(image)
    assert {round(d.box[2] - d.box[0]) for d in found} == widths


def network_with_witness(seen: float, size: str = "4,6") -> DarknetNetwork:
    """A second [yolo] sees the bright spots, surely; the first one, its witness, as ``seen`` with boxes of a size."""
    text = SMALL.replace("anchors=4,6", f"anchors={size}") + SMALL[SMALL.rindex("[convolutional]") :]
    text = (
        text.replace("[convolutional]\nfilters=6", "[route]\nlayers=0\n[convolutional]\nfilters=6") + "witnesses=3\n"
    )
    network = random_network(text)
    trunk, witness, sure = network.convolutions
    example = bright_spot_network()
    trunk.load_state_dict(example.convolutions[0].state_dict())
    for layer in (witness, sure):
        layer.load_state_dict(example.convolutions[1].state_dict())
    with torch.no_grad():
        assert witness.conv.bias is not None
        witness.conv.bias[4] += float(logit(seen)) - 10
    return network


@pytest.mark.parametrize(("seen", "count"), [(0.04, 0), (0.06, 1)])
@pytest.mark.parametrize(("size", "known"), [("4,6", 1), ("1,1", 0), ("20,20", 0), ("20,6", 1)])
def test_a_box_needs_a_witness(seen: float, count: int, size: str, known: int) -> None:
    """A witness with too wide boxes, 20 × 6, is one in the turned image, where they are high."""
    image = np.zeros((8, 16, 3), np.uint8)
    image[2:4, 8:10] = 255
    detector = VictimDetector(network_with_witness(seen, size), DetectorConfig(smaller=1.0))
    assert len(detector.detect(image)) == count * known


@pytest.mark.parametrize("turns", [1, -1])
def test_boxes_are_turned_back(turns: int) -> None:
    image = np.zeros((20, 30, 3), np.uint8)
    image[4:9, 2:14] = 255
    rows, columns = np.nonzero(np.rot90(image, turns)[..., 0])
    box = np.array([[columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]], np.float32)
    assert turned_back(box, turns, image.shape).tolist() == [[2, 4, 14, 9]]


def test_nothing_is_found_in_the_dark() -> None:
    assert VictimDetector(bright_spot_network()).detect(np.zeros((16, 32, 3), np.uint8)) == []


def test_a_network_that_cannot_be_made_smaller_stays_alone() -> None:
    network = random_network(SMALL)
    assert [n.cfg.width for n in of_both_sizes(network, 0.6)] == [16, 10]
    assert of_both_sizes(network, 0.95) == [network]


def test_files_make_a_detector(tmp_path: Path) -> None:
    (tmp_path / "n.cfg").write_text(SMALL)
    write_weights(tmp_path / "n.weights", bright_spot_network())
    loaded = VictimDetector.load(tmp_path / "n.cfg", tmp_path / "n.weights")
    assert loaded.detect(np.full((8, 16, 3), 255, np.uint8))
    write_weights(tmp_path / "n.safetensors", bright_spot_network())
    assert VictimDetector.load(tmp_path / "n.safetensors").detect(np.full((8, 16, 3), 255, np.uint8))


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((0, 0, 3), np.uint8), "empty"),
        (np.zeros((8, 16), np.uint8), "grey"),
        (np.zeros((8, 16, 1), np.uint8), "grey"),
        (np.zeros((8, 16, 3), np.float32), "float32 instead of uint8"),
    ],
)
def test_images_that_are_none_are_refused(image: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        VictimDetector(random_network(SMALL)).detect(image)


def three_classes(biases: list[float]) -> DarknetNetwork:
    """Sees a thing in every cell, with these logits of its three classes."""
    network = random_network(SMALL.replace("classes=1", "classes=3").replace("filters=6", "filters=8"))
    last = network.convolutions[-1].conv
    with torch.no_grad():
        assert last.bias is not None
        last.weight.zero_()
        last.bias.copy_(torch.tensor([0, 0, 0, 0, 9, *biases]))
    return network


def test_classes_are_known_by_their_names(tmp_path: Path) -> None:
    image, text = (
        np.zeros((8, 16, 3), np.uint8),
        SMALL.replace("classes=1", "classes=3").replace("filters=6", "filters=8"),
    )
    (tmp_path / "n.cfg").write_text(text)
    for biases, names, expected in (
        ([9, -9, -9], "person\nfire extinguisher\ncat\n", {"victim"}),
        ([-9, 9, -9], "person\nfire extinguisher\ncat\n", {"fire_extinguisher"}),
        ([9, 9, 9], "person\nfire extinguisher\ncat\n", {"victim", "fire_extinguisher"}),
        ([-9, -9, 9], "person\nfire extinguisher\ncat\n", set()),
        ([-9, -9, 9], "person\ncat\ndoll", {"victim"}),
    ):
        (tmp_path / "n.names").write_text(names)
        write_weights(tmp_path / "n.safetensors", three_classes(biases))
        found = VictimDetector.load(tmp_path / "n.safetensors").detect(image)
        assert {thing.kind for thing in found} == expected
        assert [t.confidence for t in found] == sorted((t.confidence for t in found), reverse=True)


@pytest.mark.parametrize(
    ("names", "message"),
    [(["person", "cat"], "3 classes, but 2 names"), (["a", "b", "c"], "has none of victim, hazmat_sign")],
)
def test_names_must_fit_and_be_known(names: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        VictimDetector(three_classes([0, 0, 0]), names=names)


def test_a_network_must_know_people() -> None:
    three = random_network(SMALL.replace("classes=1", "classes=3").replace("filters=6", "filters=8"))
    with pytest.raises(InputError, match="3 classes"):
        VictimDetector(three)
    with pytest.raises(InputError, match="4 channels"):
        VictimDetector(random_network(SMALL.replace("channels=3", "channels=4")))
    with pytest.raises(InputError, match="between 0 and 1"):
        VictimDetector(random_network(SMALL), DetectorConfig(confidence=1.0))
