"""Training of a network on random canvases."""

import json
from math import log
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.errors import InputError
from pipeline.files import read_text, whole_file
from pipeline.semantic_map.networks.training_loop import Learner
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detection.augmentation import CanvasSampler
from pipeline.victims.detection.average_precision import AveragePrecision
from pipeline.victims.detection.boxes import fit_anchors
from pipeline.victims.detection.darknet_cfg import OBJECTNESS, DarknetCfg, YoloHead, adapted
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.inference import to_tensor
from pipeline.victims.detection.labelled_image import TrainingImage, TrainingImages
from pipeline.victims.detection.loss import YoloLoss
from pipeline.victims.detection.network import LEAKY_SLOPE, DarknetConvolution, DarknetNetwork
from pipeline.victims.detection.training_config import YoloTrainingConfig
from pipeline.victims.detection.weights import load_network, write_weights


class YoloLearner(Learner[list[TrainingImage], DarknetNetwork]):
    """A YOLO that learns from canvases; the network (.cfg) and a card (.json) are written beside the weights."""

    SCORES = ("ap50",)

    def __init__(
        self,
        training: TrainingImages,
        validation: TrainingImages,
        config: YoloTrainingConfig,
        initial: Path,
        device: torch.device,
    ) -> None:
        """Prepare the network.

        Args:
            training: images to learn from.
            validation: images for the score.
            config: settings; the samples of a batch are canvases.
            initial: weights to begin with, their network beside them with the ending .cfg; or a .cfg, whose network
                gets the input of ``config``, anchors fitted to the images' people, and random weights.
            device: on which it learns.

        Raises:
            InputError: images show no people, or the initial network cannot be read, fits no such input, or has
                weights and more than one class.
        """
        if not any(len(validation.people(index)) for index in range(len(validation))):
            raise InputError("the images to validate with show no people")
        torch.manual_seed(config.seed)
        self._sampler = CanvasSampler(training, config)
        self._validation, self._config, self._device = validation, config, device
        path = initial.with_suffix(".cfg")
        cfg, self._text = DarknetCfg.read(path), read_text(path)
        if initial == path:
            self._text = fitted_cfg(self._text, training, config)
            network = new_network(self._text, config.prior)
        elif cfg.classes > 1:
            raise InputError(f"{path}: distinguishes {cfg.classes} classes, not people alone")
        elif any(head.scale_x_y != 1 or head.new_coords for head in cfg.heads):
            raise InputError(f"{path}: scale_x_y, new_coords: such boxes are not trained")
        else:
            network = load_network(path, initial)
        self.network = network.to(device).train()
        self._yolo_loss = YoloLoss(network.cfg)
        self.data = f"{len(training)} {len(validation)} {self._text}"

    def batch(self, number: int) -> list[TrainingImage]:
        """Canvases."""
        return self._sampler.batch(number)

    def loss(self, network: nn.Module, batch: list[TrainingImage]) -> Tensor:
        """The loss of YOLO."""
        images = to_tensor(np.stack([image.rgb for image in batch])).to(self._device)
        return self._yolo_loss(network(images), batch)

    def validate(self, network: DarknetNetwork) -> list[float]:
        """The average precision."""
        return [validate(network, self._validation, self._config.prior)]

    def write(self, network: DarknetNetwork, out: Path, about: dict[str, Any]) -> None:
        """Write weights, network and card."""
        write_weights(out, network, about["step"] * self._config.batch)
        for ending, text in ((".cfg", self._text), (".json", json.dumps(about, indent=1) + "\n")):
            with whole_file(out.with_suffix(ending)) as file:
                file.write_text(text)


def fitted_cfg(text: str, images: TrainingImages, config: YoloTrainingConfig) -> str:
    """The ``.cfg`` of a ``text``'s network for people alone, with anchors fitted to the images' people.

    Raises:
        InputError: people are too few, or the network does not halve such an input evenly.
    """
    cfg = DarknetCfg.parse(text)
    with torch.device("meta"):
        stride = DarknetNetwork(cfg).stride
    if min(config.width, config.height) < 1 or config.width % stride or config.height % stride:
        raise InputError(f"--width {config.width} --height {config.height}: multiples of {stride}")
    count = len(cfg.heads[0].anchors)
    shares = np.concatenate([images.people(index) for index in range(len(images))])
    rng = np.random.default_rng(config.seed)
    anchors = fit_anchors(shares * (config.width, config.height), count, rng)
    return adapted(text, config.width, config.height, 1, [(w, h) for w, h in anchors.round(1).tolist()])


def new_network(text: str, prior: float) -> DarknetNetwork:
    """A network with random weights, its objectness biased to ``prior`` because people are rare."""
    network = DarknetNetwork(DarknetCfg.parse(text))
    for layer in network.convolutions:
        nn.init.kaiming_normal_(layer.conv.weight, LEAKY_SLOPE, mode="fan_out")
        layer.conv.weight.data = layer.conv.weight.data.contiguous(memory_format=torch.channels_last)
    heads = [i for i, layer in enumerate(network.cfg.layers) if isinstance(layer, YoloHead)]
    for index, yolo in zip(heads, network.cfg.heads, strict=True):
        conv = cast(DarknetConvolution, network.layers[index - 1]).conv
        bias = torch.zeros(yolo.channels).view(len(yolo.mask), -1)
        bias[:, OBJECTNESS] = log(prior / (1 - prior))
        nn.init.zeros_(conv.weight)
        conv.bias = nn.Parameter(bias.flatten())
    return network


def validate(network: DarknetNetwork, images: TrainingImages, least: float) -> float:
    """Average precision, at an overlap of 0.5, of the robot's detections of ``least`` confidence or more."""
    detector = VictimDetector(network, DetectorConfig(confidence=least))
    result = AveragePrecision()
    for index in range(len(images)):
        image = images[index]
        found = detector.detect(image.rgb)
        boxes = np.array([detection.box for detection in found], np.float32).reshape(-1, 4)
        result.add(boxes, np.array([d.confidence for d in found]), image.boxes, image.ignored)
    return result.value
