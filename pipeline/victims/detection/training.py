"""Training of a network on random canvases."""

import json
from copy import deepcopy
from math import log
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.errors import InputError
from pipeline.files import read_text, whole_file
from pipeline.semantic_map.networks.parallel import TrainingWorker
from pipeline.semantic_map.networks.training_loop import TrainingLoop
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

PRIOR = 0.01
"""Objectness before training (Lin et al., RetinaNet, arXiv:1708.02002, section 3.3); average precision counts no
detection of less."""
AVERAGE = 0.998
"""Decay of the moving average of the weights per step; the average is validated and written."""
MAX_GRADIENT = 10.0  # Norm to which gradients are clipped


class YoloTrainer(TrainingLoop[list[TrainingImage]]):
    """The training of a YOLO; it writes the network (.cfg) and a card (.json) beside the weights.

    Attributes:
        network: the network that learns.
        average: the network with the moving average of the weights, which is validated and written.
    """

    SCORES = ("ap50",)

    def __init__(
        self,
        training: TrainingImages,
        validation: TrainingImages,
        config: YoloTrainingConfig,
        out: Path,
        about: dict[str, Any],
        initial: Path,
    ) -> None:
        """Start or resume a training, see :class:`TrainingLoop`.

        Args:
            training: images to learn from.
            validation: images for the score.
            config, out, about: as of :class:`TrainingLoop`; the samples of a batch are canvases.
            initial: weights to begin with, their network beside them with the ending .cfg; or a .cfg, whose network
                gets the input of ``config``, anchors fitted to the images' people, and random weights.

        Raises:
            InputError: images show no people, the checkpoint is of another training, or the initial
                network cannot be read, fits no such input, or has weights and more than one class.
        """
        if not any(len(validation.people(index)) for index in range(len(validation))):
            raise InputError("the images to validate with show no people")
        torch.manual_seed(config.seed)
        device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        draw = CanvasSampler(training, (config.width, config.height), config.batch, config.seed).batch
        self._validation = validation
        path = initial.with_suffix(".cfg")
        cfg, self._text = DarknetCfg.read(path), read_text(path)
        if initial == path:
            self._text = fitted_cfg(self._text, training, config)
            network = new_network(self._text)
        elif cfg.classes > 1:
            raise InputError(f"{path}: tells {cfg.classes} classes apart, not people alone")
        elif any(head.scale_x_y != 1 or head.new_coords for head in cfg.heads):
            raise InputError(f"{path}: scale_x_y, new_coords: such boxes are not trained")
        else:
            network = load_network(path, initial)
        self.network = network.to(device)
        self.average = deepcopy(self.network).eval()
        self._yolo_loss = YoloLoss(self.network.cfg)
        networks: dict[str, nn.Module] = {"network": self.network, "average": self.average}
        optimizer = _optimizer(self.network, config.learning_rate)
        data = f"{len(training)} {len(validation)} {self._text}"
        super().__init__(config, out, TrainingWorker(0, 1, device), about, draw, optimizer, networks, data)

    def _loss(self, batch: list[TrainingImage]) -> Tensor:
        images = to_tensor(np.stack([image.rgb for image in batch])).to(self.worker.device)
        return self._yolo_loss(self.network.train()(images), batch)

    @torch.no_grad()
    def _update(self) -> None:
        nn.utils.clip_grad_norm_(self.network.parameters(), MAX_GRADIENT)
        super()._update()
        # The average follows the network, faster during the first steps.
        share = min(AVERAGE, (1 + self.step) / (10 + self.step))
        now = self.network.state_dict()
        for name, tensor in self.average.state_dict().items():
            if tensor.is_floating_point():
                tensor.lerp_(now[name], 1 - share)

    def _validate(self) -> list[float]:
        return [validate(self.average, self._validation)]

    def _write(self, about: dict[str, Any]) -> None:
        write_weights(self.out, self.average, self.step * self.config.batch)
        for ending, text in ((".cfg", self._text), (".json", json.dumps(about, indent=1) + "\n")):
            with whole_file(self.out.with_suffix(ending)) as file:
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


def new_network(text: str) -> DarknetNetwork:
    """A network with random weights, its objectness biased to PRIOR because people are rare."""
    network = DarknetNetwork(DarknetCfg.parse(text))
    for layer in network.convolutions:
        nn.init.kaiming_normal_(layer.conv.weight, LEAKY_SLOPE, mode="fan_out")
        layer.conv.weight.data = layer.conv.weight.data.contiguous(memory_format=torch.channels_last)
    heads = [i for i, layer in enumerate(network.cfg.layers) if isinstance(layer, YoloHead)]
    for index, yolo in zip(heads, network.cfg.heads, strict=True):
        conv = cast(DarknetConvolution, network.layers[index - 1]).conv
        bias = torch.zeros(yolo.channels).view(len(yolo.mask), -1)
        bias[:, OBJECTNESS] = log(PRIOR / (1 - PRIOR))
        nn.init.zeros_(conv.weight)
        conv.bias = nn.Parameter(bias.flatten())
    return network


def validate(network: DarknetNetwork, images: TrainingImages) -> float:
    """Average precision, at an overlap of 0.5, of the robot's detector with this network."""
    detector = VictimDetector(network, PRIOR)
    result = AveragePrecision()
    for index in range(len(images)):
        image = images[index]
        found = detector.detect(image.rgb)
        boxes = np.array([detection.box for detection in found], np.float32).reshape(-1, 4)
        result.add(boxes, np.array([d.confidence for d in found]), image.boxes, image.ignored)
    return result.value


def _optimizer(network: DarknetNetwork, learning_rate: float) -> torch.optim.Optimizer:
    """AdamW, without weight decay for biases and batch normalization."""
    kernels = [p for p in network.parameters() if p.ndim > 1]
    others = [p for p in network.parameters() if p.ndim == 1]
    groups: list[dict[str, Any]] = [{"params": kernels}, {"params": others, "weight_decay": 0.0}]
    return torch.optim.AdamW(groups, learning_rate)
