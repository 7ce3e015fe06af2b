"""Training of a point classifier on random blocks of labelled clouds; the weights are written at every validation.

With ``torchrun``, several processes train together: in each step, every process learns from its own batch.
"""

import csv
import hashlib
import json
import os
import pickle
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from math import cos, pi
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, distributed, nn
from torch.nn.functional import log_softmax
from torch.nn.parallel import DistributedDataParallel

from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.labels import THESIS_FOUR
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import save_classifier, segment
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.inference import for_inference
from pipeline.semantic_map.networks.network import PointNetwork
from pipeline.semantic_map.networks.sampling import Batch, BlockSampler
from pipeline.semantic_map.networks.scores import confusion_of, iou, mean_iou
from pipeline.semantic_map.networks.threads import torch_threads
from pipeline.semantic_map.networks.training_config import TrainingConfig
from pipeline.semantic_map.networks.weights import NETWORKS

SCORES = ("miou_four", *(f"iou.{label.name.lower()}" for label in CLASSES))
"""Scores of a validation: mean IoU over the thesis's four classes, and the IoU of each class."""
WARMUP_FRACTION = 0.05
"""Fraction of the training during which the learning rate rises."""
SAVE_EVERY = 50
"""Number of steps between checkpoints, in addition to those at validations; a killed process loses at most this many
steps."""


@dataclass(frozen=True)
class TrainingWorker:
    """This process, which may train together with other processes.

    Attributes:
        rank: number of this process; process 0 validates and writes.
        count: number of processes.
        device: device on which this process computes.
    """

    rank: int
    count: int
    device: torch.device

    @classmethod
    def join(cls) -> "TrainingWorker":
        """This process with its rank from torchrun, or as the only one; on its own GPU if there are GPUs."""
        rank = int(os.environ.get("RANK", 0))
        count = int(os.environ.get("WORLD_SIZE", 1))
        device = torch.device("cpu")
        if torch.cuda.is_available():
            device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)))
            torch.cuda.set_device(device)
        if count > 1:
            distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
        return cls(rank, count, device)

    @property
    def is_leader(self) -> bool:
        """Whether this process validates and writes."""
        return self.rank == 0

    def broadcast(self, value: float) -> float:
        """The value of process 0, in every process."""
        shared = torch.tensor(value, dtype=torch.float64, device=self.device)
        if self.count > 1:
            distributed.broadcast(shared, 0)
        return float(shared)

    def leave(self) -> None:
        """Leave the group of processes."""
        if self.count > 1:
            distributed.destroy_process_group()


class Training:
    """A training run that can be interrupted at any step and resumed, with the same final weights.

    Attributes:
        config: settings.
        out: file for the weights; the checkpoint and the table (.csv) have the same name with other suffixes.
        worker: this process.
        network: the network that learns, in training mode, on the device of the worker.
        step: number of batches so far.
        processor_time: processor time for these batches, excluding validations, s.
        rows: rows of the table, one for each validation: step, mean loss since the previous row, ``SCORES``.
    """

    def __init__(
        self,
        training_clouds: Sequence[LabelledCloud],
        validation: Sequence[LabelledCloud],
        config: TrainingConfig,
        initial: PointNetwork | str,
        out: Path,
        worker: TrainingWorker,
        blocks: BlockConfig | None = None,
        about: dict[str, Any] | None = None,
    ) -> None:
        """Prepare the network, or resume from ``out``'s checkpoint if there is one.

        Args:
            training_clouds: clouds for training.
            validation: clouds for validation, from which the scores are computed.
            config: settings.
            initial: the initial network, with the clouds' channels and :data:`CLASSES`, or the name of a network,
                which then starts with random weights.
            out: file for the weights.
            worker: this process.
            blocks: how to cut clouds into blocks; by default columns of 1 m.
            about: additional metadata on the training, written with the weights.

        Raises:
            InputError: there are no labelled points for training or for validation; or the checkpoint cannot be
                read, or belongs to another training run.
        """
        training_clouds = [cloud for cloud in training_clouds if len(cloud.points)]
        for purpose, clouds in (("training", training_clouds), ("validation", validation)):
            if not any(len(cloud.points) for cloud in clouds):
                raise InputError(
                    f"the {purpose} scenes contain no labelled points; choose other datasets with --data"
                )
        self.config = config
        self.out = out
        self.worker = worker
        self._validation = validation
        self._blocks = blocks or BlockConfig()
        self._about = about or {}
        torch.manual_seed(config.seed)
        channels = 3 + training_clouds[0].points.shape[1]
        network = NETWORKS[initial](channels, len(CLASSES)) if isinstance(initial, str) else initial
        for layer in network.modules():
            if isinstance(layer, nn.Dropout):
                layer.p = 0.0  # the published 0.5 suits longer training runs
        self.network = network.to(worker.device).train()
        self._sampler = BlockSampler(training_clouds, self._blocks, network.min_points, config)
        self._weights = class_weights(training_clouds).to(worker.device)
        self._optimizer = torch.optim.AdamW(network.parameters(), config.learning_rate)
        self.step = 0
        self.processor_time = 0.0
        self.rows: list[list[float]] = []
        self._losses: list[float] = []
        # A checkpoint must come from a run with the same settings, number of processes, data and initial weights.
        points = [sum(len(cloud.points) for cloud in clouds) for clouds in (training_clouds, validation)]
        data = f"{network.NAME} {channels} {points} {self._blocks}"
        if not isinstance(initial, str):
            data += f" {checksum(network)}"
        self._settings = f"{json.dumps(asdict(config))} {worker.count} {data}"
        self._checkpoint = out.with_suffix(".checkpoint")
        if self._checkpoint.exists():
            self._resume()

    @property
    def progress(self) -> float:
        """Completed fraction of the steps or, if greater, of the time limit; at least 1 at the end."""
        if self.config.minutes is None:
            return self.step / self.config.steps
        return max(self.step / self.config.steps, self.processor_time / 60 / self.config.minutes)

    @property
    def score(self) -> float:
        """The mean IoU over the thesis's four classes at the last validation; NaN before the first one."""
        return self.rows[-1][2] if self.rows else float("nan")

    def run(self, report: Callable[["Training"], object] = lambda training: None) -> None:
        """Train to the end; ``report``: called after every step.

        If ``report`` raises an exception, a checkpoint is written before the exception propagates.
        """
        if self.progress >= 1 and self.worker.is_leader and not self.out.exists():
            self._write_weights()
        # The wrapper averages the gradients over all processes.
        shared = DistributedDataParallel(self.network) if self.worker.count > 1 else self.network
        with ThreadPoolExecutor(1) as pool, torch_threads(1):
            coming = pool.submit(self._draw, self.step)
            try:
                while self.progress < 1:
                    start = process_time()
                    batch = coming.result()
                    coming = pool.submit(self._draw, self.step + 1)  # during this step
                    self._losses.append(self._learn(shared, batch))
                    self.step += 1
                    self.processor_time = self.worker.broadcast(self.processor_time + process_time() - start)
                    if self.step % self.config.validate_every == 0 or self.progress >= 1:
                        if self.worker.is_leader:
                            self._validate()
                        # Wait for process 0 by a broadcast, in which that process only sends. After a barrier, a
                        # process that leaves at once can interrupt another's last receive.
                        self.worker.broadcast(0.0)
                    elif self.step % SAVE_EVERY == 0:
                        self._save()
                    report(self)
            finally:
                # As the last user of the group of processes, the wrapper would wait for the group's threads with
                # the GIL held, while these threads need the GIL to release their last tensors.
                shared = self.network
                if self.progress < 1:
                    self._save()

    def _draw(self, step: int) -> Batch:
        return self._sampler.batch(step * self.worker.count + self.worker.rank)

    def _learn(self, network: nn.Module, batch: Batch) -> float:
        """Take a step along the gradient of a batch's loss, and return the loss."""
        for group in self._optimizer.param_groups:
            group["lr"] = self.config.learning_rate * learning_rate_factor(
                min(self.progress + 1 / self.config.steps, 1)
            )
        logits = network(batch.points.to(self.worker.device), batch.sizes)
        loss = (
            cross_entropy(logits, batch.class_fractions.to(self.worker.device), self._weights) + self.network.penalty
        )
        self._optimizer.zero_grad()
        loss.backward()
        self._optimizer.step()
        return float(loss.detach())

    def _validate(self) -> None:
        """Validate, and write the current weights whatever the score.

        A small validation set is not reliable enough to select the best weights.
        """
        confusion = confusion_matrix(self.network, self._validation, self._blocks, self.config.seed)
        scores = [mean_iou(confusion, list(map(CLASSES.index, THESIS_FOUR))), *iou(confusion).tolist()]
        self.rows.append([self.step, float(np.mean(self._losses)), *scores])
        self._losses = []
        self._write_weights()
        with atomic_write(self.out.with_suffix(".csv")) as file, file.open("w", newline="") as stream:
            csv.writer(stream).writerows([("step", "loss", *SCORES), *self.rows])
        self._save()

    def _write_weights(self) -> None:
        now = {"step": self.step, "processor_s": round(self.processor_time, 1), SCORES[0]: self.score}
        save_classifier(self.out, self.network, self._blocks, self._about | now | {"config": asdict(self.config)})

    def _save(self) -> None:
        if self.worker.is_leader:
            on_gpu = [torch.cuda.get_rng_state(self.worker.device)] if self.worker.device.type == "cuda" else []
            state = {
                "step": self.step,
                "spent": self.processor_time,
                "rows": self.rows,
                "losses": self._losses,
                "network": self.network.state_dict(),
                "optimizer": self._optimizer.state_dict(),
                "settings": self._settings,
                "random": [torch.get_rng_state(), *on_gpu],
            }
            with atomic_write(self._checkpoint) as file:
                torch.save(state, file)

    def _resume(self) -> None:
        remedy = "delete this file or choose another --out"
        try:
            state = torch.load(self._checkpoint, map_location=self.worker.device, weights_only=True)
            if state["settings"] != self._settings:
                raise InputError(
                    f"{self._checkpoint}: the training run had other settings, data or initial weights; {remedy}"
                )
            self.network.load_state_dict(state["network"])
            self._optimizer.load_state_dict(state["optimizer"])
            on_cpu, *on_gpu = state["random"]
            torch.set_rng_state(on_cpu.cpu())
            for generator in on_gpu if self.worker.device.type == "cuda" else ():
                torch.cuda.set_rng_state(generator.cpu(), self.worker.device)
            self.step = int(state["step"])
            self.processor_time = float(state["spent"])
            self.rows = state["rows"]
            self._losses = state["losses"]
        except InputError:
            raise
        except (OSError, RuntimeError, LookupError, TypeError, ValueError, EOFError, pickle.UnpicklingError) as error:
            raise InputError(f"{self._checkpoint}: cannot be read as a training checkpoint; {remedy}") from error


def checksum(network: PointNetwork) -> str:
    """SHA-256 of a network's weights, in hexadecimal digits."""
    digest = hashlib.sha256()
    for values in network.state_dict().values():
        digest.update(values.cpu().numpy().tobytes())
    return digest.hexdigest()


def learning_rate_factor(progress: float) -> float:
    """The learning rate of a step, as a fraction of the peak rate.

    The rate rises linearly, then falls to 0 along half a cosine. ``progress``: fraction of the training that is
    completed after the step.
    """
    if progress < WARMUP_FRACTION:
        return progress / WARMUP_FRACTION
    return (1 + cos(pi * (progress - WARMUP_FRACTION) / (1 - WARMUP_FRACTION))) / 2


def confusion_matrix(
    network: PointNetwork, clouds: Sequence[LabelledCloud], blocks: BlockConfig, seed: int
) -> NDArray[np.int64]:
    """(6, 6) confusion matrix of the clouds' returns: true class (row) and predicted class (column).

    Each cloud is cut by a single grid of ``blocks``, placed randomly according to ``seed``; planes do not vote.
    """
    fast = for_inference(network)
    confusion = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    for number, cloud in enumerate(clouds):
        rng = np.random.default_rng([seed, number])
        probabilities = segment(fast, cloud.points, cloud.camera, blocks, 1, rng)
        confusion += confusion_of(cloud.counts, probabilities.argmax(axis=1))
    return confusion


def cross_entropy(logits: Tensor, targets: Tensor, weights: Tensor) -> Tensor:
    """Class-weighted mean cross entropy between (P, C) logits and the (P, C) class fractions of the points."""
    weighted = targets * weights
    return -(weighted * log_softmax(logits, dim=1)).sum() / weighted.sum()


def class_weights(clouds: Sequence[LabelledCloud]) -> Tensor:
    """(C,) float32: 1 over the square root of each class's fraction of the points; 1 for an absent class."""
    points = sum(np.bincount(cloud.classes, minlength=len(CLASSES)) for cloud in clouds)
    share = torch.from_numpy(points / np.sum(points)).float()
    return torch.where(share > 0, share.rsqrt(), 1)
