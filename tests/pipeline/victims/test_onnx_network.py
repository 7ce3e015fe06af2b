"""Detectors in ONNX files, by small networks that PyTorch exports."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.errors import InputError
from pipeline.victims.detector import VictimDetector
from pipeline.victims.onnx_network import input_size

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

WIDTH, HEIGHT = 128, 64
CLASSES = "person\ncat\nfire extinguisher\n"
PROBABILITIES = (0.9, 0.8, 0.6)
"""Of the classes, where the image is white."""
EMPTY = np.zeros((HEIGHT, WIDTH, 3), np.uint8)


class Detector(nn.Module):
    """Sees a box of 3 × 2 cells around each white cell of its grids, with ``PROBABILITIES`` of its classes."""

    def __init__(self, is_v5: bool, classes: int = 3) -> None:
        super().__init__()
        self.is_v5, self.classes = is_v5, classes

    def forward(self, images: Tensor) -> Tensor:
        grids = []
        for stride in (8, 16, 32):
            white = functional.avg_pool2d(images, stride)[:, :1]
            rows, columns = white.shape[2:]
            y, x = torch.meshgrid(torch.arange(rows) + 0.5, torch.arange(columns) + 0.5, indexing="ij")
            place = torch.stack([x, y, torch.full_like(x, 3), torch.full_like(x, 2)])[None] * stride
            sure = [white * sure for sure in PROBABILITIES[: self.classes]]
            # An anchor's objectness and its classes' probabilities are multiplied.
            sure = [0.5 * white, *(2 * one for one in sure)] if self.is_v5 else sure
            grids.append(torch.cat([place, *sure], dim=1).flatten(2))
        boxes = torch.cat(grids, dim=2)
        return torch.cat([0 * boxes, boxes, 0 * boxes], dim=2).transpose(1, 2) if self.is_v5 else boxes


class EndToEnd(nn.Module):
    """Has the corners, confidence and class of its five best boxes."""

    def forward(self, images: Tensor) -> Tensor:
        best, place = functional.avg_pool2d(images, 8)[:, 0].flatten(1).topk(5)
        return torch.stack([place, place, place + 8, place + 8, best, 0 * best], dim=2)


class Where(nn.Module):
    """Has as many rows as there are numbers other than 0, which OpenCV cannot know in advance."""

    def forward(self, images: Tensor) -> Tensor:
        return images.nonzero()


def export(network: nn.Module, path: Path, dynamic: bool = False, channels: int = 3) -> Path:
    torch.onnx.export(
        network,
        (torch.zeros(1, channels, HEIGHT, WIDTH),),
        str(path),
        dynamo=False,
        input_names=["images"],
        dynamic_axes={"images": {2: "height"}} if dynamic else None,
    )
    return path


@pytest.fixture(scope="module", params=[True, False], ids=["v5", "v8"])
def file(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = export(Detector(request.param), tmp_path_factory.mktemp("onnx") / "n.onnx")
    path.with_suffix(".names").write_text(CLASSES)
    return path


def test_what_is_white_is_found_where_it_is_and_each_object_once(file: Path) -> None:
    image = np.zeros((2 * HEIGHT, 2 * WIDTH, 3), np.uint8)
    image[32:48, 64:80] = 255  # cell 4, 2 of the finest grid, in an input of half the size
    person, bottle = VictimDetector.load(file).detect(image)
    assert (person.kind, bottle.kind) == ("victim", "fire_extinguisher")
    for found, sure in ((person, 0.9), (bottle, 0.6)):
        assert found.confidence == pytest.approx(sure, abs=1e-3)
        assert found.box == pytest.approx((72 - 24, 40 - 16, 72 + 24, 40 + 16), abs=1e-3)


@pytest.mark.usefixtures("unisolated")
def test_nothing_is_found_in_the_dark(file: Path) -> None:
    assert VictimDetector.load(file).detect(EMPTY) == []


@pytest.mark.usefixtures("unisolated")
def test_a_box_comes_back_from_bars_beside_the_image(file: Path) -> None:
    image = np.zeros((64, 64, 3), np.uint8)  # with bars of 32 pixels at both sides in the input
    image[16:24, 32:40] = 255
    person = VictimDetector.load(file).detect(image)[0]
    assert person.box == pytest.approx((36 - 12, 20 - 8, 36 + 12, 20 + 8), abs=1e-3)


@pytest.mark.usefixtures("unisolated")
def test_names_in_another_file_count_instead_of_those_beside(file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.txt"
    other.write_text("cat\nPerson\ndog")
    image = EMPTY.copy()
    image[16:24, 32:40] = 255
    (person,) = VictimDetector.load(file, names=other).detect(image)
    assert (person.kind, person.confidence) == ("victim", pytest.approx(0.8, abs=1e-3))
    other.write_text("person\ncat")
    with pytest.raises(InputError, match=r"n\.onnx: the network has 3 classes, but .*other\.txt has 2 names"):
        VictimDetector.load(file, names=other)


@pytest.mark.usefixtures("unisolated")
@pytest.mark.parametrize("is_v5", [True, False])
def test_the_only_class_is_people(is_v5: bool, tmp_path: Path) -> None:
    """A box with a single class has six numbers in YOLOv5's layout, as a detection of an end-to-end network has."""
    image = EMPTY.copy()
    image[16:24, 32:40] = 255
    (person,) = VictimDetector.load(export(Detector(is_v5, 1), tmp_path / "n.onnx")).detect(image)
    assert person.kind == "victim"


@pytest.mark.usefixtures("unisolated")
@pytest.mark.parametrize(
    ("network", "options", "message"),
    [
        (EndToEnd(), {}, r"shape \(1, 5, 6\).*export it without end-to-end detection.*yolo export"),
        (nn.Flatten(), {}, r"shape \(1, 24576\).*yolo export"),
        (Detector(False), {"dynamic": True}, "must be one colour image of a fixed size.*yolo export"),
        (Detector(False), {"channels": 1}, "must be one colour image of a fixed size"),
        (Where(), {}, "OpenCV cannot run this network.*yolo export"),
    ],
)
def test_networks_of_other_kinds_are_refused(network: nn.Module, options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"^{tmp_path}/n\.onnx: .*{message}[^\n]*$"):
        VictimDetector.load(export(network, tmp_path / "n.onnx", **options))


def test_damaged_files_are_refused(file: Path, tmp_path: Path) -> None:
    path = tmp_path / "n.onnx"
    content = file.read_bytes()
    for damaged in (b"", b"\0" * 99, b"PK\3\4" * 99, content[:40], content[:-400], content[:200] + content[300:]):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"^[^\n]*n\.onnx[^\n]*$"):
            VictimDetector.load(path)
    path.write_bytes(content)
    path.with_name("n.onnx.sha256").write_text("0" * 64 + "  n.onnx\n")
    with pytest.raises(InputError, match="SHA-256"):
        VictimDetector.load(path)


def test_a_number_of_more_than_64_bits_is_refused() -> None:
    dimensions = [b"\x08" + bytes([length]) for length in (1, 3, 64, 96)]
    content = b"".join(b"\x0a" + bytes([len(dimension)]) + dimension for dimension in dimensions)
    for number in (2, 1, 2, 11, 7):  # from the shape to the graph
        content = bytes([8 * number + 2, len(content)]) + content
    version = b"\x08" + b"\x81" * 9
    assert input_size(version + b"\x00" + content, Path("n.onnx")) == (96, 64)
    with pytest.raises(InputError, match=r"n\.onnx"):
        input_size(version + b"\x80\x00" + content, Path("n.onnx"))
