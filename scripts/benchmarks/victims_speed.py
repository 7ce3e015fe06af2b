"""How long a frame takes in the detector, beside the same network in PyTorch as it is."""

import numpy as np
import torch
from numpy.typing import NDArray

from pipeline.semantic_map.networks.dgcnn_cpu.threads import torch_threads
from pipeline.victims.detection.architectures import COCO_TINY_ANCHORS, yolov3_tiny
from pipeline.victims.detection.darknet_cfg import DarknetCfg
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.inference import FusedNetwork, to_tensor
from pipeline.victims.detection.network import DarknetNetwork
from sarsim.scripts.benchmarks.common import seconds

THREADS = 2
WIDTH, HEIGHT = 640, 480


class PlainNetwork(FusedNetwork):
    """A network in PyTorch as it is, in place of :class:`pipeline.victims.detection.inference.FusedNetwork`."""

    def __init__(self, network: DarknetNetwork):
        self.cfg, self._network = network.cfg, network

    def __call__(self, image: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
        """What goes into each [yolo], from an (H, W, 3) image of the network's size."""
        with torch.inference_mode():
            return [head[0].contiguous().numpy() for head in self._network(to_tensor(image[None]).contiguous())]


def speed(network: DarknetNetwork, rounds: int) -> dict[str, float]:
    """Median ms of a frame through the detector, and how many times as long plain PyTorch takes; they take turns."""
    ours, plain = VictimDetector(network), VictimDetector(network, make_fast=PlainNetwork)
    image = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    with torch_threads(THREADS):
        times = np.array([[seconds(d.detect, image) for d in (ours, plain)] for _ in range(2 + rounds)])[2:]
    fast, slow = times.T
    return {"detector_ms": float(1e3 * np.median(fast)), "detector_vs_torch": float(np.median(slow / fast))}


def tiny() -> DarknetNetwork:
    """YOLOv3-tiny for one class, which finds nothing: how long it takes does not depend on its weights."""
    network = DarknetNetwork(DarknetCfg.parse(yolov3_tiny(416, 416, 1, COCO_TINY_ANCHORS))).eval()
    for layer in network.convolutions:
        if layer.norm is None:
            torch.nn.init.zeros_(layer.conv.weight)
            assert layer.conv.bias is not None
            torch.nn.init.constant_(layer.conv.bias, -10)
    return network
