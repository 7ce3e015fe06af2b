"""Training: random blocks of labelled clouds in, the weights that validate best out."""

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import log_softmax

from pipeline.errors import InputError
from pipeline.files import resume, save_checkpoint, whole_file
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import CHANNELS, BlockConfig
from pipeline.semantic_map.networks.classifier import save_classifier, segment
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.ragged import RaggedDgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.threads import single_threaded
from pipeline.semantic_map.networks.parallel import Worker
from pipeline.semantic_map.networks.sampling import BlockSampler
from pipeline.semantic_map.networks.schedule import schedule
from pipeline.semantic_map.networks.scores import Confusion

WEIGHT_DECAY = 1e-3
"""Of AdamW."""
DROPOUT = 0.0
"""Before the last layer; 0.5 as published is for longer trainings."""
BALANCE = 0.5
"""A class weighs its share of the points to the power of minus this; 0 is none, 1 full balance."""
COLUMNS = ("step", "loss", "miou_four", *(f"iou.{label.name.lower()}" for label in CLASSES))
"""Of the table."""


@dataclass(frozen=True)
class TrainingConfig:
    """Settings of a training.

    Attributes:
        steps: batches.
        batch: blocks of a batch, for each worker.
        learning_rate: of AdamW at its highest.
        seed: of the first weights, the blocks and their augmentation.
        validate_every: steps.
    """

    steps: int = 3000
    batch: int = 8
    learning_rate: float = 2e-3
    seed: int = 0
    validate_every: int = 250

    def __post_init__(self) -> None:
        """Refuse what cannot be done."""
        if min(self.steps, self.batch, self.validate_every) < 1:
            raise InputError("--steps, --batch, --validate-every: at least 1")


class Trainer:
    """A training that can be left at any step and taken up again; it leaves the same weights.

    Attributes:
        config: settings.
        out: file for the weights; a checkpoint and a table (.csv) get its name with other endings.
        worker: this process.
        network: as it learns.
        step: batches so far.
        best: highest mean IoU over the thesis's four classes so far.
        rows: of the table, see ``COLUMNS``; one each time the network was validated. Losses are means since then.
    """

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
            out: file for the weights.
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
        self._validation, self._about, self._blocks = validation, about, BlockConfig()
        self.network = (initial or Dgcnn(CHANNELS, len(CLASSES))).to(worker.device).train()
        self.network.dropout.p = DROPOUT
        self._parallel = worker.share(RaggedDgcnn(self.network))
        self._optimizer = torch.optim.AdamW(
            self.network.parameters(), config.learning_rate, weight_decay=WEIGHT_DECAY
        )
        self._sampler = BlockSampler(training, self._blocks, config.batch, self.network.k, config.seed)
        self._weights = class_weights(training, BALANCE).to(worker.device)
        self.step, self.best, self.rows, self._losses = 0, float("-inf"), list[list[float]](), list[float]()
        if self._checkpoint.exists():
            resume(self._checkpoint, self._settings, worker.device, self._restore)

    def run(self, report: Callable[["Trainer"], object] = lambda trainer: None, until: int | None = None) -> None:
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
        device, batch = self.worker.device, self._sampler.batch(number)
        rate = self.config.learning_rate * schedule((self.step + 1) / self.config.steps)
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
            confusion = validate(self.network, self._validation, self._blocks, self.config.seed)
            loss, self._losses = float(np.mean(self._losses)), []
            self.rows.append([self.step, loss, confusion.miou_four, *confusion.iou.tolist()])
            if confusion.miou_four > self.best:
                self.best = confusion.miou_four
                about = {"step": self.step, "miou_four": self.best, "config": asdict(self.config)}
                save_classifier(self.out, self.network, self._blocks, self._about | about)
            with whole_file(self.out.with_suffix(".csv")) as file, file.open("w", newline="") as stream:
                csv.writer(stream).writerows([COLUMNS, *self.rows])
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
                "rows": self.rows,
                "losses": self._losses,
                "network": self.network.state_dict(),
                "optimizer": self._optimizer.state_dict(),
            }
            save_checkpoint(self._checkpoint, self._settings, state)

    def _restore(self, state: dict[str, Any]) -> None:
        self.network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self.step, self.best = state["step"], state["best"]
        self.rows, self._losses = state["rows"], state["losses"]


def validate(network: Dgcnn, clouds: Sequence[LabelledCloud], blocks: BlockConfig, seed: int) -> Confusion:
    """What the network makes of the clouds, cut as ``blocks`` says by a ``seed``, as the robot would use it."""
    fast = FastDgcnn(network)
    result = Confusion(np.zeros((len(CLASSES), len(CLASSES)), np.int64))
    for number, cloud in enumerate(clouds):
        rng = np.random.default_rng([seed, number])
        probabilities = segment(fast, cloud.points, cloud.camera, blocks, 1, rng)
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


def _check(training: Sequence[LabelledCloud], validation: Sequence[LabelledCloud]) -> None:
    for purpose, clouds in (("train", training), ("validate", validation)):
        if not any(len(cloud.points) for cloud in clouds):
            raise InputError(f"no labelled points to {purpose} with")
