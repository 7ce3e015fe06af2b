"""The training loop of any network: it learns from batches and writes its weights at every validation."""

import csv
import json
import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from math import cos, pi
from pathlib import Path
from time import process_time
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
import torch
from torch import Tensor

from pipeline.errors import InputError
from pipeline.files import whole_file
from pipeline.semantic_map.networks.parallel import TrainingWorker
from pipeline.semantic_map.networks.training_config import TrainingConfig

WARM_UP_SHARE = 0.05
"""Share of the training in which the learning rate rises."""
SAVE_EVERY = 50
"""Steps between checkpoints, apart from those at validations: a killed process loses no more steps."""

Batch = TypeVar("Batch")


class TrainingLoop(ABC, Generic[Batch]):
    """A training that can be interrupted at any step and resumed; it ends with the same weights.

    Attributes:
        SCORES: names of a validation's scores.
        config: settings.
        out: file for the weights; a checkpoint and a table (.csv) get its name with other endings.
        worker: this process.
        step: number of batches so far.
        spent: s of processor time for these batches, without validations.
        rows: of the table, one for each validation: step, mean loss since the row before, scores.
    """

    SCORES: ClassVar[tuple[str, ...]]

    def __init__(
        self,
        config: TrainingConfig,
        out: Path,
        worker: TrainingWorker,
        about: dict[str, Any],
        draw: Callable[[int], Batch],
        optimizer: torch.optim.Optimizer,
        networks: dict[str, torch.nn.Module],
        data: str = "",
    ) -> None:
        """Start, or resume from ``out``'s checkpoint if there is one.

        Args:
            config: settings.
            out: file for the weights.
            worker: this process.
            about: more metadata on the training, written with the weights.
            draw: returns the batch of a step; called in another thread during the step before.
            optimizer: of the network that learns.
            networks: networks whose weights a checkpoint keeps, by their names in it.
            data: a description of the data; a checkpoint must agree with it and with ``config``.

        Raises:
            InputError: the checkpoint is of another training.
        """
        self.config, self.out, self.worker = config, out, worker
        self._about, self._draw, self._optimizer = about, draw, optimizer
        self._parts: dict[str, Any] = networks | {"optimizer": optimizer}
        self._settings = json.dumps(asdict(config)) + data
        self._checkpoint = out.with_suffix(".checkpoint")
        self.step, self.spent = 0, 0.0
        self.rows, self._losses = list[list[float]](), list[float]()
        if self._checkpoint.exists():
            self._resume()

    @abstractmethod
    def _loss(self, batch: Batch) -> Tensor:
        """The loss of the network on a batch."""

    @abstractmethod
    def _validate(self) -> list[float]:
        """The ``SCORES`` of the network with its present weights."""

    @abstractmethod
    def _write(self, about: dict[str, Any]) -> None:
        """Write the weights, with metadata on their training."""

    def _update(self) -> None:
        """Change the network's weights by their gradients."""
        self._optimizer.step()

    @property
    def progress(self) -> float:
        """Share of the training that is done, 1 at the end: of the steps or, if greater, of the limited minutes."""
        if self.config.minutes is None:
            return self.step / self.config.steps
        return max(self.step / self.config.steps, self.spent / 60 / self.config.minutes)

    def run(self, report: Callable[[Self], object] = lambda training: None) -> None:
        """Train to the end. ``report`` is called after every step; if it raises, a checkpoint is written first."""
        if self.progress >= 1 and self.worker.leads and not self.out.exists():
            self._write_weights()
        with ThreadPoolExecutor(1) as pool:
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
                    elif self.step % SAVE_EVERY == 0:
                        self._save()
                    report(self)
            finally:
                if self.progress < 1:
                    self._save()

    def _learn(self, batch: Batch) -> float:
        rate = self.config.learning_rate * schedule(min(self.progress + 1 / self.config.steps, 1))
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        loss = self._loss(batch)
        self._optimizer.zero_grad()
        loss.backward()
        self._update()
        return float(loss.detach())

    @property
    def score(self) -> float:
        """The first score of the last validation; NaN before it."""
        return self.rows[-1][2] if self.rows else float("nan")

    def _keep(self) -> None:
        """Validate, and write the present weights whatever the score: a small validation chooses badly."""
        if self.worker.leads:
            scores = self._validate()
            self.rows.append([self.step, float(np.mean(self._losses)), *scores])
            self._losses = []
            self._write_weights()
            with whole_file(self.out.with_suffix(".csv")) as file, file.open("w", newline="") as stream:
                csv.writer(stream).writerows([("step", "loss", *self.SCORES), *self.rows])
            self._save()
        self.worker.wait()

    def _write_weights(self) -> None:
        now = {"step": self.step, "processor_s": round(self.spent, 1), self.SCORES[0]: self.score}
        self._write(self._about | now | {"config": asdict(self.config)})

    def _save(self) -> None:
        if self.worker.leads:
            state = {"step": self.step, "spent": self.spent, "rows": self.rows, "losses": self._losses}
            state |= {name: part.state_dict() for name, part in self._parts.items()}
            with whole_file(self._checkpoint) as file:
                torch.save({"settings": self._settings} | state, file)

    def _resume(self) -> None:
        remedy = "remove it, or choose another --out"
        try:
            state = torch.load(self._checkpoint, map_location=self.worker.device, weights_only=True)
            is_same = state["settings"] == self._settings
            for name, part in self._parts.items() if is_same else ():
                part.load_state_dict(state[name])
            self.step, self.spent = int(state["step"]), float(state["spent"])
            self.rows, self._losses = state["rows"], state["losses"]
        except (OSError, RuntimeError, LookupError, TypeError, ValueError, EOFError, pickle.UnpicklingError) as error:
            raise InputError(f"{self._checkpoint}: not a checkpoint of this program: {remedy}") from error
        if not is_same:
            raise InputError(f"{self._checkpoint} is of a training with other settings or data: {remedy}")


def schedule(progress: float, warm_up: float = WARM_UP_SHARE) -> float:
    """The learning rate, as a share of the highest, at a progress of 0 to 1: a linear rise, then half a cosine."""
    if progress < warm_up:
        return progress / warm_up
    return (1 + cos(pi * (progress - warm_up) / (1 - warm_up))) / 2
