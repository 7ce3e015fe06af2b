"""Training: random blocks of labelled clouds in, the weights that validate best out."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import log_softmax

from pipeline.errors import InputError
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import save_classifier, segment
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.curves import Curves
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.ragged import RaggedDgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.threads import single_threaded
from pipeline.semantic_map.networks.parallel import Worker
from pipeline.semantic_map.networks.sampling import BlockSampler, SamplingConfig
from pipeline.semantic_map.networks.scores import Confusion
from pipeline.training import resume, save_checkpoint, schedule


@dataclass(frozen=True)
class TrainingConfig:
    """Settings of a training.

    Attributes:
        steps: batches.
        seed: of the first weights, the blocks and their augmentation.
        blocks: how clouds are cut.
        sampling: of each worker's batches.
        optimizer: AdamW, or SGD with momentum 0.9 as published.
        learning_rate: at its highest; 0.1 for SGD as published.
        weight_decay: of the optimizer.
        warm_up: share of the steps in which the learning rate rises; then it falls as a cosine.
        dropout: before the last layer; 0.5 as published is for longer trainings.
        balance: a class weighs its share of the points to the power of minus this; 0 is none, 1 full balance.
        validate_every: steps.
        keep: the weights that validate best, or the last ones: where few clouds validate, the best are so by chance.
    """

    steps: int = 3000
    seed: int = 0
    blocks: BlockConfig = field(default_factory=BlockConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    optimizer: Literal["adamw", "sgd"] = "adamw"
    learning_rate: float = 2e-3
    weight_decay: float = 1e-3
    warm_up: float = 0.05
    dropout: float = 0.0
    balance: float = 0.5
    validate_every: int = 250
    keep: Literal["best", "last"] = "best"

    def __post_init__(self) -> None:
        """Refuse what cannot be done."""
        if self.steps < 1 or self.validate_every < 1 or self.sampling.blocks < 1:
            raise InputError("--steps, --validate-every, --sampling.blocks: at least 1")
        if not 0 <= self.warm_up < 1:
            raise InputError(f"--warm-up {self.warm_up}: at least 0 and less than 1")


class Trainer:
    """A training that can be left at any step and taken up again; it leaves the same weights."""

    def __init__(
        self,
        training: Sequence[LabelledCloud],
        validation: Sequence[LabelledCloud],
        config: TrainingConfig,
        out: Path,
        worker: Worker,
        about: dict[str, Any],
        initial: Dgcnn | None = None,
    ) -> None:
        """Begin, or go on from ``out``'s checkpoint where there is one.

        Args:
            training: clouds to learn from.
            validation: clouds by which the best weights are chosen.
            config: settings.
            out: file for the weights; checkpoint, table and picture get its name with other endings.
            worker: this process.
            about: what else is written into the weights' file on how they came about.
            initial: a network to begin with, of six channels and :data:`CLASSES`; random weights if not given.

        Raises:
            InputError: there is nothing to learn from or to validate with, or the checkpoint is of another training.
        """
        training = [cloud for cloud in training if len(cloud.points)]
        _check(training, validation)
        torch.manual_seed(config.seed)
        self.config, self.out, self.worker = config, out, worker
        self._validation, self._about = validation, about
        self.network = (initial or Dgcnn(channels=6, classes=len(CLASSES))).to(worker.device).train()
        self.network.dropout.p = config.dropout
        self._parallel = worker.share(RaggedDgcnn(self.network))
        self._optimizer = _optimizer(config, self.network)
        self._sampler = BlockSampler(training, config.blocks, config.sampling, self.network.k, config.seed)
        self._weights = class_weights(training, config.balance).to(worker.device)
        self.step, self.best, self.curves, self._losses = 0, float("-inf"), Curves(), list[float]()
        if self._checkpoint.exists():
            resume(self._checkpoint, self._settings, worker.device, self._restore)

    def run(
        self, report: Callable[["Trainer"], object] = lambda trainer: None, until: int | None = None
    ) -> None:
        """Train to the end, or until a step. ``report`` is called after every step.

        Left before the end or interrupted, it leaves a checkpoint.
        """
        last = self.config.steps if until is None else min(until, self.config.steps)
        try:
            with single_threaded():
                while self.step < last:
                    self._take_step()
                    report(self)
        finally:
            if self.step < self.config.steps:
                self._save()

    def _take_step(self) -> None:
        self._losses.append(self._learn(self.step * self.worker.count + self.worker.rank))
        self.step += 1
        if self.step % self.config.validate_every == 0 or self.step == self.config.steps:
            self._validate()

    def _learn(self, number: int) -> float:
        """Take a step with the batch of that number; the loss."""
        config, device, batch = self.config, self.worker.device, self._sampler.batch(number)
        torch.manual_seed(
            int(np.random.SeedSequence([config.seed, number]).generate_state(1)[0])
        )  # of dropout
        rate = config.learning_rate * schedule((self.step + 1) / config.steps, config.warm_up)
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        logits = self._parallel(batch.points.to(device), batch.sizes)
        loss = cross_entropy(logits, batch.shares.to(device), self._weights)
        self._optimizer.zero_grad()
        loss.backward()
        self._optimizer.step()
        return float(loss.detach())

    def _validate(self) -> None:
        if self.worker.leads:
            confusion = validate(self.network, self._validation, self.config)
            self.curves.add(self.step, float(np.mean(self._losses)), confusion)
            self._losses = []
            if confusion.miou_four > self.best or self.config.keep == "last":
                self.best = max(self.best, confusion.miou_four)
                training = self._about | {
                    "step": self.step,
                    "miou_four": confusion.miou_four,
                    "config": asdict(self.config),
                }
                save_classifier(self.out, self.network, self.config.blocks, training)
            self.curves.write(self.out.with_suffix(".csv"), self.out.with_suffix(".svg"))
            self._save()
        self.worker.wait()

    @property
    def _checkpoint(self) -> Path:
        return self.out.with_suffix(".checkpoint")

    @property
    def _settings(self) -> str:
        return json.dumps(asdict(self.config))

    def _save(self) -> None:
        if self.worker.leads:
            state = {
                "step": self.step,
                "best": self.best,
                "rows": self.curves.rows,
                "losses": self._losses,
                "network": self.network.state_dict(),
                "optimizer": self._optimizer.state_dict(),
            }
            save_checkpoint(self._checkpoint, self._settings, state)

    def _restore(self, state: dict[str, Any]) -> None:
        self.network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self.step, self.best, self._losses = state["step"], state["best"], state["losses"]
        self.curves = Curves(state["rows"])


def validate(network: Dgcnn, clouds: Sequence[LabelledCloud], config: TrainingConfig) -> Confusion:
    """What the network makes of the clouds, as the robot would use it."""
    fast = FastDgcnn(network)
    result = Confusion(np.zeros((len(CLASSES), len(CLASSES)), np.int64))
    for number, cloud in enumerate(clouds):
        rng = np.random.default_rng([config.seed, number])
        probabilities = segment(fast, cloud.points, cloud.camera, config.blocks, 1, rng)
        result += Confusion.of(cloud.counts, probabilities.argmax(axis=1))
    return result


def cross_entropy(logits: Tensor, shares: Tensor, weights: Tensor) -> Tensor:
    """Mean over the points, each class weighted, of (P, C) logits from the (P, C) shares of the classes."""
    weighted = shares * weights
    return -(weighted * log_softmax(logits, dim=1)).sum() / weighted.sum()


def class_weights(clouds: Sequence[LabelledCloud], balance: float) -> Tensor:
    """(C,) float32: a class's share of the points to the power of ``-balance``; 1 for one that does not occur."""
    points = sum(np.bincount(cloud.classes, minlength=len(CLASSES)) for cloud in clouds)
    share = points / np.sum(points)
    return torch.from_numpy(np.where(share > 0, np.maximum(share, 1e-4) ** -balance, 1)).float()


def _optimizer(config: TrainingConfig, network: Dgcnn) -> torch.optim.Optimizer:
    parameters, rate, decay = network.parameters(), config.learning_rate, config.weight_decay
    if config.optimizer == "sgd":
        return torch.optim.SGD(parameters, rate, momentum=0.9, weight_decay=decay)
    return torch.optim.AdamW(parameters, rate, weight_decay=decay)


def _check(training: Sequence[LabelledCloud], validation: Sequence[LabelledCloud]) -> None:
    for purpose, clouds in (("train", training), ("validate", validation)):
        if not any(len(cloud.points) for cloud in clouds):
            raise InputError(f"no labelled points to {purpose} with")
