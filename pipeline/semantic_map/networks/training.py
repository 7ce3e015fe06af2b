"""Training of a point classifier on random blocks of labelled clouds."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import log_softmax

from pipeline.errors import InputError
from pipeline.labels import THESIS_FOUR
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import save_classifier, segment
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.inference import for_inference, for_training
from pipeline.semantic_map.networks.network import PointNetwork
from pipeline.semantic_map.networks.parallel import TrainingWorker
from pipeline.semantic_map.networks.sampling import Batch, BlockSampler
from pipeline.semantic_map.networks.scores import confusion_of, iou, mean_iou
from pipeline.semantic_map.networks.threads import torch_threads
from pipeline.semantic_map.networks.training_config import TrainingConfig
from pipeline.semantic_map.networks.training_loop import TrainingLoop
from pipeline.semantic_map.networks.weights import NETWORKS


class PointTrainer(TrainingLoop[Batch]):
    """The training of a network on points; its score is the mean IoU over the thesis's four classes."""

    SCORES = ("miou_four", *(f"iou.{label.name.lower()}" for label in CLASSES))

    def __init__(
        self,
        training: Sequence[LabelledCloud],
        validation: Sequence[LabelledCloud],
        config: TrainingConfig,
        out: Path,
        worker: TrainingWorker,
        about: dict[str, Any],
        initial: PointNetwork | str,
        blocks: BlockConfig | None = None,
    ) -> None:
        """Start or resume a training, see :class:`TrainingLoop`.

        Args:
            training: clouds to learn from.
            validation: clouds for the scores.
            config, out, worker, about: as of :class:`TrainingLoop`; the samples of a batch are blocks.
            initial: a network to begin with, with the clouds' channels and :data:`CLASSES`, or the name of a network,
                which begins with random weights.
            blocks: how to cut clouds into blocks; by default columns of 1 m.

        Raises:
            InputError: there is nothing to learn from or to validate with, or the checkpoint is of another training.
        """
        training = [cloud for cloud in training if len(cloud.points)]
        for purpose, clouds in (("train", training), ("validate", validation)):
            if not any(len(cloud.points) for cloud in clouds):
                raise InputError(f"no labelled points to {purpose} with")
        torch.manual_seed(config.seed)
        self._validation, self._blocks = validation, blocks or BlockConfig()
        channels = 3 + training[0].points.shape[1]
        network = NETWORKS[initial](channels, len(CLASSES)) if isinstance(initial, str) else initial
        if config.batch < 2:
            raise InputError(f"--batch {config.batch}: at least 2, for batch norm over blocks")
        self.network = network.to(worker.device).train()
        for layer in network.modules():
            if isinstance(layer, nn.Dropout):
                layer.p = 0.0  # the published 0.5 suits longer trainings
        self._parallel = worker.share(for_training(network))
        sampler = BlockSampler(training, self._blocks, config.batch, network.fewest, config.seed)
        self._weights = class_weights(training).to(worker.device)
        optimizer = torch.optim.AdamW(self.network.parameters(), config.learning_rate)

        def draw(step: int) -> Batch:
            return sampler.batch(step * worker.count + worker.rank)

        networks: dict[str, nn.Module] = {"network": self.network}
        points = [sum(len(cloud.points) for cloud in clouds) for clouds in (training, validation)]
        data = f"{network.NAME} {channels} {worker.count} {points} {self._blocks}"
        super().__init__(config, out, worker, about, draw, optimizer, networks, data)

    def run(self, report: Callable[[Self], object] = lambda training: None) -> None:
        """Train as :meth:`TrainingLoop.run`, while PyTorch starts no threads of its own."""
        with torch_threads(1):
            super().run(report)

    def _loss(self, batch: Batch) -> Tensor:
        logits = self._parallel(batch.points.to(self.worker.device), batch.sizes)
        return cross_entropy(logits, batch.shares.to(self.worker.device), self._weights) + self.network.penalty

    def _validate(self) -> list[float]:
        confusion = validate(self.network, self._validation, self._blocks, self.config.seed)
        return [mean_iou(confusion, list(map(CLASSES.index, THESIS_FOUR))), *iou(confusion).tolist()]

    def _write(self, about: dict[str, Any]) -> None:
        save_classifier(self.out, self.network, self._blocks, about)


def validate(network: PointNetwork, clouds: Sequence[LabelledCloud], blocks: BlockConfig, seed: int) -> NDArray:
    """(6, 6) int64 confusion matrix of the clouds' returns: true class (row) and predicted class (column).

    The clouds are cut by one grid of ``blocks``, at random from ``seed``; planes do not vote.
    """
    fast = for_inference(network)
    confusion = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    for number, cloud in enumerate(clouds):
        rng = np.random.default_rng([seed, number])
        probabilities = segment(fast, cloud.points, cloud.camera, blocks, 1, rng)
        confusion += confusion_of(cloud.counts, probabilities.argmax(axis=1))
    return confusion


def cross_entropy(logits: Tensor, shares: Tensor, weights: Tensor) -> Tensor:
    """Class-weighted mean cross entropy of (P, C) logits with the (P, C) shares of the classes of each point."""
    weighted = shares * weights
    return -(weighted * log_softmax(logits, dim=1)).sum() / weighted.sum()


def class_weights(clouds: Sequence[LabelledCloud]) -> Tensor:
    """(C,) float32: 1 over the root of a class's share of the points; 1 for one that does not occur."""
    points = sum(np.bincount(cloud.classes, minlength=len(CLASSES)) for cloud in clouds)
    share = torch.from_numpy(points / np.sum(points)).float()
    return torch.where(share > 0, share.rsqrt(), 1)
