"""Networks for tests."""

from pathlib import Path

import torch

from pipeline.victims.detection.darknet_cfg import DarknetCfg
from pipeline.victims.detection.network import DarknetNetwork

SHIPPED = Path(__file__).parents[4] / "assets" / "weights"
TINY = (SHIPPED / "yolov3-tiny.cfg").read_text()
FULL = (SHIPPED / "yolov3.cfg").read_text().replace("width=416", "width=160").replace("height=416", "height=128")
OWN = (SHIPPED / "yolov3-small.cfg").read_text().replace("width=512", "width=128").replace("height=384", "height=96")
SMALL = """
[net]
width=16
height=8
channels=3

[convolutional]
batch_normalize=1
filters=2
size=3
stride=2
pad=1
activation=leaky

[convolutional]
filters=6
size=1
activation=linear

[yolo]
mask=0
anchors=4,6
classes=1
num=1
"""
"""One convolution and one anchor in 8 × 4 cells."""


def random_network(text: str, seed: int = 0) -> DarknetNetwork:
    """Random weights and statistics that keep the numbers about as large from layer to layer."""
    torch.manual_seed(seed)
    network = DarknetNetwork(DarknetCfg.parse(text)).eval()
    for layer in network.convolutions:
        torch.nn.init.kaiming_normal_(layer.conv.weight, 0.1)
        if layer.norm is not None:
            assert layer.norm.running_mean is not None and layer.norm.running_var is not None
            layer.norm.running_mean.uniform_(-0.1, 0.1)
            layer.norm.running_var.uniform_(0.8, 1.2)
            torch.nn.init.uniform_(layer.norm.weight, 0.7, 0.9)
            torch.nn.init.uniform_(layer.norm.bias, -0.1, 0.1)
    return network
