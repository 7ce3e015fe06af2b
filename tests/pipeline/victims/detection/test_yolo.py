"""The fixed architectures, in training and fused for inference, against OpenCV's reader of Darknet."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from pipeline.errors import InputError
from pipeline.victims.detection.boxes import decode, joined
from pipeline.victims.detection.inference import FusedYolo, to_tensor
from pipeline.victims.detection.weights import load_shipped, read_weights, write_weights
from pipeline.victims.detection.yolo import YoloSmall, YoloTiny

WEIGHTS = Path(__file__).parents[4] / "assets" / "weights"
TINY_BYTES = 35434956  # of yolov3-tiny.weights as published, for 80 classes and three anchors on a grid
IMAGE = np.random.default_rng(1).integers(0, 256, (96, 128, 3), np.uint8)


def test_the_arena_network_is_what_its_cfg_says(tmp_path: Path) -> None:
    """Both find the same boxes in the same image."""
    arena, _ = load_shipped(WEIGHTS / "victims.safetensors")
    path = tmp_path / "a.weights"
    write_weights(path, arena)
    peer = cv2.dnn.readNetFromDarknet(str(WEIGHTS / "yolov3-small.cfg"), str(path))
    peer.setInput(cv2.dnn.blobFromImage(IMAGE, 1 / 255))
    rows = np.concatenate(peer.forward(peer.getUnconnectedOutLayersNames()))
    theirs = rows[(rows[:, 4] >= 0.01) & (rows[:, 5] >= 0.2)]  # OpenCV drops those below 0.2
    with torch.inference_mode():
        heads = [head[0].numpy() for head in arena(to_tensor(IMAGE[None]))]
    boxes, scores = joined(decode(head, grid, 128, 96, 0.01) for head, grid in zip(heads, arena.grids, strict=True))
    assert scores.max() > 0
    ours = boxes[scores[:, 0] >= 0.2]
    assert len(ours) == len(theirs)
    middle, half = theirs[:, :2] * (128, 96), theirs[:, 2:4] * (128, 96) / 2
    peers = np.concatenate([middle - half, middle + half], axis=1)
    np.testing.assert_allclose(np.sort(ours, axis=0), np.sort(peers, axis=0), atol=0.05)


@pytest.mark.parametrize("part", [0, 1])
def test_the_fused_network_answers_as_the_one_that_learns(part: int) -> None:
    network = load_shipped(WEIGHTS / "victims.safetensors")[part]
    with torch.inference_mode():
        heads = [head[0].numpy() for head in network(to_tensor(IMAGE[None]))]
    boxes, scores = joined(decode(head, grid, 128, 96, 1e-3) for head, grid in zip(heads, network.grids, strict=True))
    fused = FusedYolo(network).boxes(IMAGE, (128, 96), 1e-3)
    np.testing.assert_allclose(fused[0], np.clip(boxes, 0, (128, 96) * 2), atol=0.01)
    np.testing.assert_allclose(fused[1], scores, atol=1e-4)


def test_the_coco_network_is_yolov3_tiny_but_for_its_classes() -> None:
    ours = sum(tensor.numel() for layer in YoloTiny().convolutions for tensor in _learnt(layer))
    left_out = (3 * 85 - 36) * (512 + 1 + 256 + 1)  # rows of the kernels and biases before both grids
    assert 4 * (ours + left_out) + 20 == TINY_BYTES


def _learnt(layer) -> list[torch.Tensor]:
    return [tensor for name, tensor in layer.state_dict().items() if "num_batches" not in name]


def test_weights_are_read_back(tmp_path: Path) -> None:
    torch.manual_seed(0)
    network, again = YoloSmall(), YoloSmall()
    path = tmp_path / "a.weights"
    write_weights(path, network, seen=12)
    read_weights(path, again)
    for one, other in zip(network.state_dict().values(), again.state_dict().values(), strict=True):
        torch.testing.assert_close(one, other)
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(InputError, match=r"a\.weights"):
        read_weights(path, again)
