"""Training of a network on random canvases."""

import json
import re
from math import log
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.files import atomic_write, read_text
from pipeline.semantic_map.networks.training_loop import Learner
from pipeline.tracks.find import VICTIM
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detection.augmentation import CanvasSampler
from pipeline.victims.detection.average_precision import AveragePrecision
from pipeline.victims.detection.boxes import Boxes
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.inference import FusedYolo, to_tensor
from pipeline.victims.detection.labelled_image import TrainingImage, TrainingImages
from pipeline.victims.detection.loss import YoloLoss
from pipeline.victims.detection.training_config import YoloTrainingConfig
from pipeline.victims.detection.weights import read_weights, write_weights
from pipeline.victims.detection.yolo import LEAKY_SLOPE, OBJECTNESS, STRIDE, Anchors, YoloSmall

Size = tuple[int, int]
"""Width and height of a network's input, pixels."""
USUAL = DetectorConfig().size
"""The input size for which the anchors are given."""


class YoloLearner(Learner[list[TrainingImage], YoloSmall]):
    """A YOLOv3-small that learns from canvases; its .cfg and a card (.json) are written next to the weights."""

    SCORES = ("ap50",)

    def __init__(
        self,
        training: TrainingImages,
        validation: TrainingImages,
        config: YoloTrainingConfig,
        cfg: Path,
        initial: Path | None,
        device: torch.device,
    ) -> None:
        """Prepare the network.

        Args:
            training: images to learn from.
            validation: images for the score.
            config: settings; the samples of a batch are canvases.
            cfg: Darknet's description of YOLOv3-small, in which the input size and the anchors are replaced.
            initial: file of initial weights from an earlier training; by default they are random.
            device: the device to train on.

        Raises:
            InputError: the training or validation images show no people, the initial weights cannot be read or are
                another network's, or a side of the input is not a multiple of the coarsest cell.
        """
        if not any(len(validation.people(index)) for index in range(len(validation))):
            raise InputError("no validation image shows a person; choose datasets that contain victims with --data")
        torch.manual_seed(config.seed)
        self._sampler = CanvasSampler(training, config)
        self._validation, self._config, self._device = validation, config, device
        self._size = config.width, config.height
        anchors = scaled_anchors(self._size)
        network = new_network(anchors, config.prior)
        if initial is not None:
            read_weights(initial, network)
        self._text = with_input(read_text(cfg), self._size, anchors)
        self.network = network.to(device).train()
        self._yolo_loss = YoloLoss(network.grids, self._size)
        self.data = f"{len(training)} {len(validation)} {self._text}"

    def batch(self, number: int) -> list[TrainingImage]:
        """The canvases of a batch."""
        return self._sampler.batch(number)

    def loss(self, network: nn.Module, batch: list[TrainingImage]) -> Tensor:
        """The YOLO loss of a batch."""
        images = to_tensor(np.stack([image.rgb for image in batch])).to(self._device)
        return self._yolo_loss(network(images), batch)

    def validate(self, network: YoloSmall) -> list[float]:
        """The average precision on the validation images."""
        return [validate(network, self._size, self._validation, self._config.prior)]

    def write(self, network: YoloSmall, out: Path, about: dict[str, Any]) -> None:
        """Write the weights, the ``.cfg`` and the card."""
        write_weights(out, network, about["step"] * self._config.batch)
        for ending, text in ((".cfg", self._text), (".json", json.dumps(about, indent=1) + "\n")):
            with atomic_write(out.with_suffix(ending)) as file:
                file.write_text(text)


def scaled_anchors(size: Size) -> Anchors:
    """The anchors for an input of another size; InputError unless its sides are multiples of STRIDE."""
    width, height = size
    if min(size) < 1 or width % STRIDE or height % STRIDE:
        raise InputError(f"--width {width} --height {height}: both must be positive multiples of {STRIDE}")
    across, down = width / USUAL[0], height / USUAL[1]
    return tuple((round(w * across, 1), round(h * down, 1)) for w, h in YoloSmall.ANCHORS)


def with_input(text: str, size: Size, anchors: Anchors) -> str:
    """The text of a ``.cfg`` with another input size and other anchors."""
    listed = ", ".join(f"{w:g},{h:g}" for w, h in anchors)
    for key, value in (("width", size[0]), ("height", size[1]), ("anchors", listed)):
        text = re.sub(rf"^{key}=.*", f"{key}={value}", text, flags=re.MULTILINE)
    return text


def new_network(anchors: Anchors, prior: float) -> YoloSmall:
    """A network with random weights and an initial objectness of ``prior``, because people are rare."""
    network = YoloSmall(anchors)
    for layer in network.convolutions:
        nn.init.kaiming_normal_(layer.conv.weight, LEAKY_SLOPE, mode="fan_out")
        layer.conv.weight.data = layer.conv.weight.data.contiguous(memory_format=torch.channels_last)
        if layer.conv.bias is not None:  # the last layer before a grid
            bias = torch.zeros(len(layer.conv.bias)).view(len(network.grids[0].mask), -1)
            bias[:, OBJECTNESS] = log(prior / (1 - prior))
            nn.init.zeros_(layer.conv.weight)
            layer.conv.bias = nn.Parameter(bias.flatten())
    return network


class ArenaNetworkAlone:
    """An arena network as the detector uses it, but without the COCO network."""

    kinds: ClassVar[dict[str, list[int]]] = {VICTIM: [0]}

    def __init__(self, network: YoloSmall, size: Size) -> None:
        """Copy the network, for images fitted into ``size``."""
        self._network, self._size = FusedYolo(network), size

    def find(self, image: Rgb, least: float) -> Boxes:
        """Boxes of people in an image, and their (N, 1) confidences."""
        return self._network.boxes(image, self._size, least)


def validate(network: YoloSmall, size: Size, images: TrainingImages, least: float) -> float:
    """Average precision, at an overlap of 0.5, of the detections with a confidence of at least ``least``."""
    detector = VictimDetector(ArenaNetworkAlone(network, size), DetectorConfig(confidence=least))
    result = AveragePrecision()
    for index in range(len(images)):
        image = images[index]
        found = detector.detect(image.rgb)
        boxes = np.array([detection.box for detection in found], np.float32).reshape(-1, 4)
        result.add(boxes, np.array([d.confidence for d in found]), image.boxes, image.ignored)
    return result.value
