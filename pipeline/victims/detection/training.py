"""Training of a network on random canvases; the weights that validate best are kept."""

import csv
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import asdict, dataclass
from math import log
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import torch
from torch import nn

from pipeline.errors import InputError
from pipeline.files import resume, save_checkpoint, whole_file
from pipeline.semantic_map.networks.schedule import schedule
from pipeline.victims.detection.architectures import yolov3, yolov3_small, yolov3_tiny
from pipeline.victims.detection.augmentation import CanvasSampler
from pipeline.victims.detection.average_precision import AveragePrecision
from pipeline.victims.detection.boxes import fit_anchors
from pipeline.victims.detection.darknet_cfg import DarknetCfg, Yolo
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.inference import to_tensor
from pipeline.victims.detection.labelled_image import LabelledImage, LabelledImages
from pipeline.victims.detection.loss import YoloLoss
from pipeline.victims.detection.network import DarknetConvolution, DarknetNetwork
from pipeline.victims.detection.weights import load_network, write_weights

COLUMNS = ("step", "loss", "ap50")
BUILDERS = {"yolov3-small": (yolov3_small, 9), "yolov3-tiny": (yolov3_tiny, 6), "yolov3": (yolov3, 9)}
"""Function that writes each network's ``.cfg``, and its number of anchors."""
LOWEST_CONFIDENCE = 0.01
"""Least confidence of the detections that average precision counts."""
PRIOR = 0.01
"""Objectness before training (Lin et al., RetinaNet, arXiv:1708.02002, section 3.3)."""
WEIGHT_DECAY = 1e-2
"""Of kernels, for AdamW."""
WARM_UP = 0.05
"""Share of the steps in which the learning rate rises; then it falls as a cosine."""
AVERAGE = 0.998
"""Share that the average of the weights keeps of itself in a step; the average is what is written."""
MAX_GRADIENT = 10.0
"""Norm to which gradients are clipped."""


@dataclass(frozen=True)
class TrainingConfig:
    """Settings of a training.

    Attributes:
        network: what is trained.
        width, height: of its input, pixels; multiples of 32.
        steps: batches.
        batch: canvases in a batch.
        seed: of the first weights, the anchors, the canvases.
        learning_rate: of AdamW at its highest.
        validate_every: steps.
    """

    network: Literal["yolov3-small", "yolov3-tiny", "yolov3"] = "yolov3-small"
    width: int = 512
    height: int = 384
    steps: int = 6000
    batch: int = 16
    seed: int = 0
    learning_rate: float = 2e-3
    validate_every: int = 500

    def __post_init__(self) -> None:
        """Raise InputError for settings that cannot work."""
        if min(self.width, self.height) < 32 or self.width % 32 or self.height % 32:
            raise InputError(f"--width {self.width} --height {self.height}: multiples of 32")
        if min(self.steps, self.batch, self.validate_every) < 1:
            raise InputError("--steps, --batch, --validate-every: at least 1")


class Trainer:
    """A training that can be interrupted at any step and resumed; it ends with the same weights.

    Attributes:
        config: settings.
        out: file for the weights; the network (.cfg), their card (.json), a checkpoint and a table (.csv) get its
            name with other endings.
        network: as it learns.
        average: of its weights over the steps: what is validated and written.
        step: batches so far.
        best: highest average precision so far.
        rows: of the table: step, loss, average precision.
    """

    def __init__(
        self,
        training: LabelledImages,
        validation: LabelledImages,
        config: TrainingConfig,
        out: Path,
        about: dict[str, Any],
        initial: Path | None = None,
    ) -> None:
        """Begin, or go on from ``out``'s checkpoint where there is one.

        Args:
            training: images to learn from.
            validation: images by which the best weights are chosen.
            config: settings.
            out: file for the weights.
            about: what else the card says of how they came about.
            initial: weights to begin with, their network beside them with the ending .cfg; if not given, random ones
                of a network whose anchors fit the images' people.

        Raises:
            InputError: images show no people, the checkpoint is of another training, or the initial
                network cannot be read or tells more than one class apart.
        """
        if not any(len(validation.people(index)) for index in range(len(validation))):
            raise InputError("the images to validate with show no people")
        torch.manual_seed(config.seed)
        self.config, self.out, self._about = config, out, about
        self._sampler = CanvasSampler(training, (config.width, config.height), config.batch, config.seed)
        self._validation = validation
        self._device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self._text = _cfg_beside(initial) if initial else fitted_cfg(training, config)
        network = load_network(initial.with_suffix(".cfg"), initial) if initial else new_network(self._text)
        self.network = network.to(self._device)
        self.average = deepcopy(self.network).eval()
        self._loss = YoloLoss(self.network.cfg)
        self._optimizer = _optimizer(self.network, config.learning_rate)
        self.step, self.best, self.rows, self._losses = 0, float("-inf"), list[list[float]](), list[float]()
        if self._checkpoint.exists():
            resume(self._checkpoint, self._settings, self._device, self._restore)

    def run(self, report: Callable[["Trainer"], object] = lambda trainer: None) -> None:
        """Train to the end. ``report`` is called after every step. Interrupted, it leaves a checkpoint."""
        with ThreadPoolExecutor(1) as pool:
            coming = pool.submit(self._sampler.batch, self.step)
            try:
                while self.step < self.config.steps:
                    batch = coming.result()
                    coming = pool.submit(self._sampler.batch, self.step + 1)  # while this one is learned from
                    self._losses.append(self._learn(batch))
                    self.step += 1
                    if self.step % self.config.validate_every == 0 or self.step == self.config.steps:
                        self._validate()
                    report(self)
            except KeyboardInterrupt:
                self._save()
                raise

    def _learn(self, batch: list[LabelledImage]) -> float:
        config = self.config
        for group in self._optimizer.param_groups:
            group["lr"] = config.learning_rate * schedule((self.step + 1) / config.steps, WARM_UP)
        images = to_tensor(np.stack([image.rgb for image in batch])).to(self._device)
        loss = self._loss(self.network.train()(images), batch)
        self._optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), MAX_GRADIENT)
        self._optimizer.step()
        self._follow()
        return float(loss.detach())

    @torch.no_grad()
    def _follow(self) -> None:
        """Move the average towards the network; at first faster, while there is little to average."""
        share = min(AVERAGE, (1 + self.step) / (10 + self.step))
        now = self.network.state_dict()
        for name, tensor in self.average.state_dict().items():
            if tensor.is_floating_point():
                tensor.lerp_(now[name], 1 - share)

    def _validate(self) -> None:
        precision = validate(self.average, self._validation)
        self.rows.append([self.step, float(np.mean(self._losses)), precision])
        self._losses = []
        if precision > self.best:
            self.best = precision
            self._write()
        with whole_file(self.out.with_suffix(".csv")) as file, file.open("w", newline="") as stream:
            csv.writer(stream).writerows([COLUMNS, *self.rows])
        self._save()

    def _write(self) -> None:
        """Write the averaged weights, their network and their card."""
        write_weights(self.out, self.average, self.step * self.config.batch)
        card = self._about | {"step": self.step, "ap50": self.best, "config": asdict(self.config)}
        for ending, text in ((".cfg", self._text), (".json", json.dumps(card, indent=1) + "\n")):
            with whole_file(self.out.with_suffix(ending)) as file:
                file.write_text(text)

    @property
    def _checkpoint(self) -> Path:
        return self.out.with_suffix(".checkpoint")

    @property
    def _settings(self) -> str:
        return json.dumps(asdict(self.config)) + self._text

    @property
    def _parts(self) -> dict[str, Any]:
        return {"network": self.network, "average": self.average, "optimizer": self._optimizer}

    def _save(self) -> None:
        state = {"step": self.step, "best": self.best, "rows": self.rows, "losses": self._losses}
        state |= {name: part.state_dict() for name, part in self._parts.items()}
        save_checkpoint(self._checkpoint, self._settings, state)

    def _restore(self, state: dict[str, Any]) -> None:
        for name, part in self._parts.items():
            part.load_state_dict(state[name])
        self.step, self.best = state["step"], state["best"]
        self.rows, self._losses = state["rows"], state["losses"]


def fitted_cfg(images: LabelledImages, config: TrainingConfig) -> str:
    """The ``.cfg`` of a network with anchors fitted to the images' people. InputError if these are too few."""
    build, count = BUILDERS[config.network]
    shares = np.concatenate([images.people(index) for index in range(len(images))])
    rng = np.random.default_rng(config.seed)
    anchors = fit_anchors(shares * (config.width, config.height), count, rng)
    return build(config.width, config.height, 1, [(w, h) for w, h in anchors.round(1).tolist()])


def _cfg_beside(weights: Path) -> str:
    """The ``.cfg`` beside a weights file. InputError if its network has other classes than people."""
    path = weights.with_suffix(".cfg")
    cfg = DarknetCfg.read(path)
    if cfg.classes != 1:
        raise InputError(f"{path}: tells {cfg.classes} classes apart, not people alone")
    return path.read_text()


def new_network(text: str) -> DarknetNetwork:
    """A network with random weights that expects people to be rare."""
    network = DarknetNetwork(DarknetCfg.parse(text))
    for layer in network.convolutions:
        nn.init.kaiming_normal_(layer.conv.weight, 0.1, mode="fan_out")
        layer.conv.weight.data = layer.conv.weight.data.contiguous(memory_format=torch.channels_last)
    heads = [i for i, layer in enumerate(network.cfg.layers) if isinstance(layer, Yolo)]
    for index, yolo in zip(heads, network.cfg.heads, strict=True):
        conv = cast(DarknetConvolution, network.layers[index - 1]).conv
        bias = torch.zeros(len(yolo.mask), 5 + yolo.classes)
        bias[:, 4] = log(PRIOR / (1 - PRIOR))
        nn.init.normal_(conv.weight, std=0.01)
        conv.bias = nn.Parameter(bias.flatten())
    return network


def validate(network: DarknetNetwork, images: LabelledImages) -> float:
    """Average precision at an overlap of 0.5 of the detector that the robot would use."""
    detector = VictimDetector(network, LOWEST_CONFIDENCE)
    result = AveragePrecision()
    for index in range(len(images)):
        image = images[index]
        found = detector.detect(image.rgb)
        boxes = np.array([detection.box for detection in found], np.float32).reshape(-1, 4)
        result.add(boxes, np.array([d.confidence for d in found]), image.boxes, image.ignored)
    return result.value


def _optimizer(network: DarknetNetwork, learning_rate: float) -> torch.optim.Optimizer:
    """AdamW; biases and batch normalization do not decay."""
    kernels = [p for p in network.parameters() if p.ndim == 4]
    others = [p for p in network.parameters() if p.ndim != 4]
    groups = [{"params": kernels, "weight_decay": WEIGHT_DECAY}, {"params": others, "weight_decay": 0.0}]
    return torch.optim.AdamW(groups, learning_rate)
