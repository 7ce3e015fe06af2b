"""The training loop of all networks, which learns from batches and writes the weights at every validation."""

import csv
import json
import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import asdict
from pathlib import Path
from time import process_time
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.semantic_map.networks.parallel import TrainingWorker
from pipeline.semantic_map.networks.threads import torch_threads
from pipeline.semantic_map.networks.training_config import TrainingConfig

Batch = TypeVar("Batch")
Network = TypeVar("Network", bound=nn.Module)


class Learner(ABC, Generic[Batch, Network]):
    """The parts that differ between training runs.

    Attributes:
        SCORES: names of a validation's scores, the main one first.
        THREADS: number of threads in which PyTorch computes; None for its default.
        network: the network being trained, in training mode, on the device used for training.
        data: description of the training data, which must match that in a checkpoint.
    """

    SCORES: ClassVar[tuple[str, ...]]
    THREADS: ClassVar[int | None] = None
    network: Network
    data: str

    @abstractmethod
    def batch(self, number: int) -> Batch:
        """The batch with this number; numbers ascend. Called from another thread, during the preceding step."""

    @abstractmethod
    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        """The loss on a batch; ``network`` is the network being trained, possibly wrapped to average gradients."""

    @abstractmethod
    def validate(self, network: Network) -> list[float]:
        """The ``SCORES`` of a network, which must not be changed."""

    @abstractmethod
    def write(self, network: Network, out: Path, about: dict[str, Any]) -> None:
        """Write a network's weights to a file, with metadata on their training; the network must not be changed."""


class TrainingLoop(Generic[Batch, Network]):
    """A training run that can be interrupted at any step and resumed, with the same final weights.

    Attributes:
        learner: the parts specific to this training.
        config: settings.
        out: file for the weights; the checkpoint and the table (.csv) have the same name with other suffixes.
        worker: this process.
        step: number of batches so far.
        spent: processor time for these batches, excluding validations, s.
        rows: rows of the table, one for each validation: step, mean loss since the previous row, scores.
        result: the network that is validated and written: the one being trained, or a moving average of its weights.
    """

    def __init__(
        self,
        learner: Learner[Batch, Network],
        config: TrainingConfig,
        out: Path,
        worker: TrainingWorker,
        about: dict[str, Any] | None = None,
    ) -> None:
        """Start, or resume from ``out``'s checkpoint if there is one.

        Args:
            learner: the parts specific to this training.
            config: settings.
            out: file for the weights.
            worker: this process.
            about: additional metadata on the training, written with the weights.

        Raises:
            InputError: the checkpoint cannot be read, or belongs to another training run.
        """
        self.learner, self.config, self.out, self.worker = learner, config, out, worker
        self._about = about or {}
        self._shared: nn.Module = learner.network
        self._optimizer = _optimizer(learner.network, config)
        self._parts: dict[str, Any] = {"network": learner.network, "optimizer": self._optimizer}
        self.result = learner.network
        if config.optimization.averaging is not None:
            self.result = self._parts["average"] = deepcopy(learner.network).eval()
        self._settings = f"{json.dumps(asdict(config))} {worker.count} {learner.data}"
        self._checkpoint = out.with_suffix(".checkpoint")
        self.step, self.spent = 0, 0.0
        self.rows, self._losses = list[list[float]](), list[float]()
        if self._checkpoint.exists():
            self._resume()

    @property
    def progress(self) -> float:
        """Completed share of the training: of the steps or, if greater, of the time limit; at least 1 at the end."""
        if self.config.minutes is None:
            return self.step / self.config.steps
        return max(self.step / self.config.steps, self.spent / 60 / self.config.minutes)

    @property
    def score(self) -> float:
        """The main score of the last validation; NaN before the first one."""
        return self.rows[-1][2] if self.rows else float("nan")

    def run(self, report: Callable[["TrainingLoop[Any, Any]"], object] = lambda training: None) -> None:
        """Train to the end. ``report`` is called after every step; if it raises, a checkpoint is written first."""
        if self.progress >= 1 and self.worker.leads and not self.out.exists():
            self._write_weights()
        self._shared = self.worker.share(self.learner.network)
        with ThreadPoolExecutor(1) as pool, torch_threads(self.learner.THREADS or torch.get_num_threads()):
            coming = pool.submit(self._draw, self.step)
            try:
                while self.progress < 1:
                    start = process_time()
                    batch = coming.result()
                    coming = pool.submit(self._draw, self.step + 1)  # during this step
                    self._losses.append(self._learn(batch))
                    self.step += 1
                    self.spent = self.worker.agreed(self.spent + process_time() - start)
                    if self.step % self.config.validate_every == 0 or self.progress >= 1:
                        self._keep()
                    elif self.step % self.config.optimization.save_every == 0:
                        self._save()
                    report(self)
            finally:
                # As the last user of the group of processes, the wrapper would wait for the group's threads with
                # the GIL held, while these need it to release their last tensors.
                self._shared = self.learner.network
                if self.progress < 1:
                    self._save()

    def _draw(self, step: int) -> Batch:
        return self.learner.batch(step * self.worker.count + self.worker.rank)

    def _learn(self, batch: Batch) -> float:
        config = self.config.optimization
        when = min(self.progress + 1 / self.config.steps, 1), self.config.steps
        for group in self._optimizer.param_groups:
            group["lr"] = self.config.learning_rate * config.schedule.rate(*when)
            group["betas"] = config.schedule.momentum(*when), group["betas"][1]
        loss = self.learner.loss(self._shared, batch)
        self._optimizer.zero_grad()
        loss.backward()
        if config.most_gradient is not None:
            nn.utils.clip_grad_norm_(self.learner.network.parameters(), config.most_gradient)
        self._optimizer.step()
        if config.averaging is not None:
            # The average follows the network, faster during the first steps.
            self._follow(min(config.averaging, (1 + self.step) / (10 + self.step)))
        return float(loss.detach())

    @torch.no_grad()
    def _follow(self, kept: float) -> None:
        """Keep the share ``kept`` of the moving average, and take the rest from the network."""
        now = self.learner.network.state_dict()
        for name, tensor in self.result.state_dict().items():
            if tensor.is_floating_point():
                tensor.lerp_(now[name], 1 - kept)

    def _keep(self) -> None:
        """Validate, and write the current weights whatever the score: a small validation set selects badly."""
        if self.worker.leads:
            scores = self.learner.validate(self.result)
            self.rows.append([self.step, float(np.mean(self._losses)), *scores])
            self._losses = []
            self._write_weights()
            with atomic_write(self.out.with_suffix(".csv")) as file, file.open("w", newline="") as stream:
                csv.writer(stream).writerows([("step", "loss", *self.learner.SCORES), *self.rows])
            self._save()
        self.worker.wait()

    def _write_weights(self) -> None:
        now = {"step": self.step, "processor_s": round(self.spent, 1), self.learner.SCORES[0]: self.score}
        self.learner.write(self.result, self.out, self._about | now | {"config": asdict(self.config)})

    def _save(self) -> None:
        if self.worker.leads:
            state = {"step": self.step, "spent": self.spent, "rows": self.rows, "losses": self._losses}
            state |= {name: part.state_dict() for name, part in self._parts.items()}
            state |= {"settings": self._settings, "random": self.worker.random_state()}
            with atomic_write(self._checkpoint) as file:
                torch.save(state, file)

    def _resume(self) -> None:
        remedy = "delete this file or choose another --out"
        try:
            state = torch.load(self._checkpoint, map_location=self.worker.device, weights_only=True)
            is_same = state["settings"] == self._settings
            for name, part in self._parts.items() if is_same else ():
                part.load_state_dict(state[name])
            if is_same:
                self.worker.set_random_state(state["random"])
            self.step, self.spent = int(state["step"]), float(state["spent"])
            self.rows, self._losses = state["rows"], state["losses"]
        except (OSError, RuntimeError, LookupError, TypeError, ValueError, EOFError, pickle.UnpicklingError) as error:
            raise InputError(f"{self._checkpoint}: cannot be read as a training checkpoint; {remedy}") from error
        if not is_same:
            raise InputError(f"{self._checkpoint}: written by a training run with other settings or data; {remedy}")


def _optimizer(network: nn.Module, config: TrainingConfig) -> torch.optim.Optimizer:
    kernels = [p for p in network.parameters() if p.ndim > 1]
    vectors = [p for p in network.parameters() if p.ndim == 1]
    groups: list[dict[str, Any]] = [
        {"params": kernels, "weight_decay": config.optimization.weight_decay},
        {"params": vectors, "weight_decay": config.optimization.weight_decay_of_vectors},
    ]
    return torch.optim.AdamW(groups, config.learning_rate)
