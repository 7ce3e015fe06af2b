"""Join two networks into the shipped detector: ``join_detectors.py COCO.weights RENDERED.weights OUT.safetensors``.

``assets/weights/victims.cfg`` describes the whole: a layer that copies the image, YOLOv3-tiny as trained on COCO, a
route back to the image, and a network trained on rendered arenas. Each file has its .cfg beside it.
"""

import sys
from pathlib import Path

import torch
from torch import Tensor

from pipeline.victims.detection.darknet_cfg import OBJECTNESS, DarknetCfg, YoloHead
from pipeline.victims.detection.detector import PERSON
from pipeline.victims.detection.network import DarknetNetwork
from pipeline.victims.detection.weights import load_network, write_weights
from sarsim.assets import asset

ADDED = 1  # Layers before each of the two networks: the copy, the route
TEDDY_BEAR = {80: 77}
"""Number of the class ``teddy bear`` by the number of classes: dolls look like one to COCO, which has none."""


@torch.no_grad()
def join(network: DarknetNetwork, parts: list[DarknetNetwork]) -> None:
    """Fill a network of one class, people, with what the parts know of them; RuntimeError if it is another."""
    copy = network.convolutions[0].conv
    copy.weight.copy_(torch.eye(len(copy.weight))[..., None, None])
    assert copy.bias is not None
    copy.bias.zero_()
    place = ADDED
    for part in parts:
        ends = [index - 1 for index in part.cfg.places]
        for index, layer in enumerate(part.layers):
            state = layer.state_dict()
            if index in ends:
                yolo = part.cfg.layers[index + 1]
                assert isinstance(yolo, YoloHead)
                state = {name: kept_alone(tensor, yolo) for name, tensor in state.items()}
            network.layers[place + index].load_state_dict(state)
        place += len(part.layers) + ADDED


def kept_alone(tensor: Tensor, yolo: YoloHead) -> Tensor:
    """Of the kernel or bias before a [yolo], the rows of each class that is kept: boxes, objectness and it."""
    anchors = tensor.unflatten(0, (len(yolo.mask), -1))
    numbers = [number_of[yolo.classes] for number_of in (PERSON, TEDDY_BEAR) if yolo.classes in number_of]
    rows = [[*range(OBJECTNESS + 1), OBJECTNESS + 1 + number] for number in numbers]
    return torch.cat([anchors[:, some].flatten(0, 1) for some in rows])


def main() -> None:
    """Entry point."""
    coco, rendered, out = map(Path, sys.argv[1:])
    network = DarknetNetwork(DarknetCfg.read(asset("weights", "victims.cfg")))
    join(
        network, [load_network(coco.with_suffix(".cfg"), coco), load_network(rendered.with_suffix(".cfg"), rendered)]
    )
    write_weights(out, network)


if __name__ == "__main__":
    main()
