"""What the arena network proposes and the COCO network sees, by networks that see spots of one colour."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.victims.config import DetectorConfig
from pipeline.victims.two_stages import TwoStageNetwork, rotated_back, surroundings

SHIPPED = Path(__file__).parents[3] / "assets" / "weights" / "victims.safetensors"
RED, BLUE = 0, 2
CONFIG = DetectorConfig()


class Spots:
    """Sees a box around all that is bright in a channel, if it is upright enough; and boxes that are always there."""

    def __init__(self, channel: int, max_width: float = 9, score: float = 0.8, always: int = 0) -> None:
        self.channel, self.max_width, self.score, self.always = channel, max_width, score, always
        self.looks: list[tuple[int, ...]] = []

    def boxes(self, image, size, least, heads=None):
        self.looks.append(image.shape)
        rows, columns = np.nonzero(image[..., self.channel] > 200)
        boxes = [(8.0 * k, 0.0, 8.0 * k + 4, 4.0) for k in range(self.always)]
        scores = [0.03] * self.always
        if len(rows) and np.ptp(columns) <= self.max_width * np.ptp(rows):
            boxes.append((columns.min(), rows.min(), columns.max() + 1, rows.max() + 1))
            scores.append(self.score)
        kept = np.array(scores) >= least
        return np.array(boxes, np.float32).reshape(-1, 4)[kept], np.array(scores, np.float32)[kept, None]


def image_of(*spots: tuple[int, slice, slice]) -> np.ndarray:
    image = np.zeros((240, 320, 3), np.uint8)
    for channel, rows, columns in spots:
        image[rows, columns, channel] = 255
    return image


PERSON = slice(100, 140), slice(200, 220)


def found(network: TwoStageNetwork, image: np.ndarray) -> list[tuple[list[int], float]]:
    boxes, scores = network.find(image, 0.25)
    sure = scores[:, 0] >= 0.25
    return [
        (box.round().astype(int).tolist(), round(float(s), 2))
        for box, s in zip(boxes[sure], scores[sure, 0], strict=True)
    ]


def test_a_candidate_counts_only_with_a_witness() -> None:
    for other, count in (((BLUE, *PERSON), 1), ((BLUE, slice(100, 110), slice(200, 203)), 0)):
        network = TwoStageNetwork(Spots(RED, score=0.9), Spots(BLUE, score=0.06), CONFIG)
        assert found(network, image_of((RED, *PERSON), other)) == [([200, 100, 220, 140], 0.9)] * count


def test_what_the_witness_is_sure_of_counts_by_itself() -> None:
    network = TwoStageNetwork(Spots(RED, score=0.3), Spots(BLUE, score=0.7), CONFIG)
    boxes = found(network, image_of((RED, *PERSON), (BLUE, slice(110, 120), slice(205, 210))))
    assert boxes == [([205, 110, 210, 120], 0.7)]


def test_the_witness_looks_only_where_there_is_a_candidate() -> None:
    arena, coco = Spots(RED), Spots(BLUE)
    network = TwoStageNetwork(arena, coco, CONFIG)
    assert found(network, image_of((BLUE, *PERSON))) == []
    assert (len(arena.looks), coco.looks) == (1, [])
    found(network, image_of((RED, *PERSON), (BLUE, *PERSON)))
    assert coco.looks == [(50, 50, 3)]  # 1.25 times as large as the longer side


@pytest.mark.parametrize(("spot", "looks"), [((slice(100, 120), slice(200, 240)), 3), (PERSON, 1)])
def test_who_may_lie_is_seen_from_the_side_too(spot: tuple[slice, slice], looks: int) -> None:
    """Here the witness knows only people who stand, and those who are 20 × 40 pixels do so in the turned image."""
    coco = Spots(BLUE, max_width=0.8, score=0.06)
    assert len(found(TwoStageNetwork(Spots(RED), coco, CONFIG), image_of((RED, *spot), (BLUE, *spot)))) == 1
    assert len(coco.looks) == looks


def test_the_witness_looks_everywhere_if_there_are_hints_everywhere() -> None:
    image = image_of((BLUE, *PERSON))
    for always, sizes in ((CONFIG.max_hints, set()), (CONFIG.max_hints + 1, {image.shape})):
        coco = Spots(BLUE)
        found_there = found(TwoStageNetwork(Spots(RED, always=always), coco, CONFIG), image)
        assert set(coco.looks) == sizes
        assert len(found_there) == len(sizes)


def test_surroundings_end_at_the_edge_of_the_image() -> None:
    image = np.arange(20 * 30 * 3, dtype=np.uint16).reshape(20, 30, 3)
    corner, part = surroundings(image, np.array([0, 2, 4, 18], np.float32))
    assert corner.tolist() == [0, 0]
    np.testing.assert_array_equal(part, image[:20, :12])


@pytest.mark.parametrize("turns", [1, -1])
def test_boxes_are_turned_back(turns: int) -> None:
    image = np.zeros((20, 30, 3), np.uint8)
    image[4:9, 2:14] = 255
    rows, columns = np.nonzero(np.rot90(image, turns)[..., 0])
    box = np.array([[columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]], np.float32)
    assert rotated_back(box, turns, image.shape).tolist() == [[2, 4, 14, 9]]


def test_the_shipped_networks_see_nothing_in_nothing() -> None:
    boxes, _ = TwoStageNetwork.load(SHIPPED, CONFIG).find(np.zeros((48, 64, 3), np.uint8), 0.25)
    assert len(boxes) == 0


def test_other_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "v.safetensors"
    path.write_bytes(SHIPPED.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"v\.safetensors"):
        TwoStageNetwork.load(path, CONFIG)
    with pytest.raises(InputError, match=r"v\.safetensors.*the weights do not fit the network"):
        path.write_bytes((SHIPPED.parent / "hazmat.safetensors").read_bytes())
        TwoStageNetwork.load(path, CONFIG)
