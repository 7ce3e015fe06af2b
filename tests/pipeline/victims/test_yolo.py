"""The networks of the shipped detector against OpenCV's reader of Darknet."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from safetensors.numpy import load_file

from pipeline.victims.yolo import Yolo, load_shipped
from tests.pipeline.victims.networks import HEADER

WEIGHTS = Path(__file__).parents[3] / "assets" / "weights"
SIZE = 128, 96
LEAST = 1e-5
IMAGE = np.random.default_rng(1).integers(0, 256, (*SIZE[::-1], 3), np.uint8)
TENSORS = ("conv.bias", "norm.bias", "norm.weight", "norm.running_mean", "norm.running_var", "conv.weight")
"""The tensors of a convolution, in Darknet's order."""
CONV = "[convolutional]\nfilters={}\nsize={}\npad=1\nactivation={}\nbatch_normalize={}\n"
ANCHORS = 2 * "10,14, 23,27, 37,58, 81,82, 135,169, 344,319, "


def convolution(filters: int, size: int = 3) -> str:
    return CONV.format(filters, size, "leaky", 1)


def tiny_cfg() -> str:
    """YOLOv3-tiny as published, but with one class, and with each anchor of a grid twice."""
    head = CONV.format(36, 1, "linear", 0) + "[yolo]\nclasses=1\nnum=12\n"
    trunk = "".join(convolution(2**k) + "[maxpool]\nsize=2\nstride=2\n" for k in range(4, 9))
    trunk += convolution(512) + "[maxpool]\nsize=2\nstride=1\n" + convolution(1024) + convolution(256, 1)
    coarse = convolution(512) + head + f"anchors={ANCHORS[:-2]}\nmask=3,4,5,9,10,11\n"
    fine = "[route]\nlayers=-4\n" + convolution(128, 1) + "[upsample]\nstride=2\n[route]\nlayers=-1,8\n"
    fine += convolution(256) + head + f"anchors={ANCHORS[:-2]}\nmask=0,1,2,6,7,8\n"
    return f"[net]\nwidth={SIZE[0]}\nheight={SIZE[1]}\nchannels=3\n" + trunk + coarse + fine


def peer_boxes(network: Yolo, cfg: str) -> np.ndarray:
    """(N, 4) boxes that OpenCV finds in IMAGE, with the network's weights in Darknet's order."""
    tensors = load_file(WEIGHTS / "victims.safetensors")
    names = [f"layers.{number}.{name}" for number in network.LAYERS for name in TENSORS]
    weights = HEADER + b"".join(tensors[name].astype("<f4").tobytes() for name in names if name in tensors)
    peer = cv2.dnn.readNetFromDarknet(*(np.frombuffer(content, np.uint8) for content in (cfg.encode(), weights)))
    peer.setInput(cv2.dnn.blobFromImage(IMAGE, 1 / 255))
    rows = np.concatenate(peer.forward(peer.getUnconnectedOutLayersNames()))
    theirs = rows[(rows[:, 4] >= LEAST) & (rows[:, 5] >= LEAST)]
    middle, half = theirs[:, :2] * SIZE, theirs[:, 2:4] * SIZE / 2
    return np.clip(np.concatenate([middle - half, middle + half], axis=1), 0, SIZE * 2)


@pytest.mark.parametrize("part", [0, 1])
def test_opencv_finds_the_same_boxes(part: int) -> None:
    network = load_shipped(WEIGHTS / "victims.safetensors")[part]
    cfg = tiny_cfg() if part else (WEIGHTS / "yolov3-small.cfg").read_text()
    theirs = peer_boxes(network, cfg.replace("[yolo]", "[yolo]\nthresh=0.000001\nnms_threshold=0"))
    boxes, scores = network.boxes(IMAGE, SIZE, LEAST)
    ours = boxes[scores[:, 0] >= LEAST]
    assert len(ours) > 3
    np.testing.assert_allclose(np.sort(ours, axis=0), np.sort(theirs, axis=0), atol=0.05)


def test_heads_are_computed_on_demand_the_coarsest_first() -> None:
    network = load_shipped(WEIGHTS / "victims.safetensors")[1]
    coarse, everything = (network.boxes(IMAGE, SIZE, 1e-6, heads) for heads in (1, None))
    np.testing.assert_array_equal(coarse[0], everything[0][: len(coarse[0])])
    assert 0 < len(coarse[0]) < len(everything[0])
