"""Training of a point classifier on random blocks of labelled clouds."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
from pipeline.semantic_map.networks.inference import for_inference
from pipeline.semantic_map.networks.network import PointNetwork
from pipeline.semantic_map.networks.sampling import Batch, BlockSampler
from pipeline.semantic_map.networks.scores import confusion_of, iou, mean_iou
from pipeline.semantic_map.networks.training_config import PointTrainingConfig
from pipeline.semantic_map.networks.training_loop import Learner
from pipeline.semantic_map.networks.weights import NETWORKS


class PointLearner(Learner[Batch, PointNetwork]):
    """Trains a point network on blocks; the score is the mean IoU over the thesis's four classes."""

    SCORES = ("miou_four", *(f"iou.{label.name.lower()}" for label in CLASSES))
    THREADS = 1

    def __init__(
        self,
        training: Sequence[LabelledCloud],
        validation: Sequence[LabelledCloud],
        config: PointTrainingConfig,
        initial: PointNetwork | str,
        device: torch.device,
        blocks: BlockConfig | None = None,
    ) -> None:
        """Prepare the network.

        Args:
            training: clouds to learn from.
            validation: clouds for the scores.
            config: settings.
            initial: the initial network, with the clouds' channels and :data:`CLASSES`, or the name of a network,
                which then starts with random weights.
            device: device to train on.
            blocks: how to cut clouds into blocks; by default columns of 1 m.

        Raises:
            InputError: there are no labelled points for training or for validation.
        """
        training = [cloud for cloud in training if len(cloud.points)]
        for purpose, clouds in (("training", training), ("validation", validation)):
            if not any(len(cloud.points) for cloud in clouds):
                raise InputError(
                    f"the {purpose} scenes contain no labelled points; choose other datasets with --data"
                )
        torch.manual_seed(config.seed)
        self._validation, self._blocks, self._seed = validation, blocks or BlockConfig(), config.seed
        channels = 3 + training[0].points.shape[1]
        network = NETWORKS[initial](channels, len(CLASSES)) if isinstance(initial, str) else initial
        self.network = network.to(device).train()
        for layer in network.modules():
            if isinstance(layer, nn.Dropout):
                layer.p = 0.0  # the published 0.5 suits longer training runs
        self._sampler = BlockSampler(training, self._blocks, network.fewest, config)
        self._device, self._weights = device, class_weights(training).to(device)
        points = [sum(len(cloud.points) for cloud in clouds) for clouds in (training, validation)]
        self.data = f"{network.NAME} {channels} {points} {self._blocks}"

    def batch(self, number: int) -> Batch:
        """The batch of blocks with this number."""
        return self._sampler.batch(number)

    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        """The sum of the cross entropy and the network's penalty."""
        logits = network(batch.points.to(self._device), batch.sizes)
        return cross_entropy(logits, batch.shares.to(self._device), self._weights) + self.network.penalty

    def validate(self, network: PointNetwork) -> list[float]:
        """The mean IoU over the thesis's four classes, and the IoU of each class."""
        confusion = validate(network, self._validation, self._blocks, self._seed)
        return [mean_iou(confusion, list(map(CLASSES.index, THESIS_FOUR))), *iou(confusion).tolist()]

    def write(self, network: PointNetwork, out: Path, about: dict[str, Any]) -> None:
        """Write a file that the robot's classifier can load."""
        save_classifier(out, network, self._blocks, about)


def validate(network: PointNetwork, clouds: Sequence[LabelledCloud], blocks: BlockConfig, seed: int) -> NDArray:
    """(6, 6) int64 confusion matrix of the clouds' returns: true class (row) and predicted class (column).

    Each cloud is cut by a single grid of ``blocks``, placed randomly according to ``seed``; planes do not vote.
    """
    fast = for_inference(network)
    confusion = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    for number, cloud in enumerate(clouds):
        rng = np.random.default_rng([seed, number])
        probabilities = segment(fast, cloud.points, cloud.camera, blocks, 1, rng)
        confusion += confusion_of(cloud.counts, probabilities.argmax(axis=1))
    return confusion


def cross_entropy(logits: Tensor, shares: Tensor, weights: Tensor) -> Tensor:
    """Class-weighted mean cross entropy between (P, C) logits and the (P, C) class shares of the points."""
    weighted = shares * weights
    return -(weighted * log_softmax(logits, dim=1)).sum() / weighted.sum()


def class_weights(clouds: Sequence[LabelledCloud]) -> Tensor:
    """(C,) float32: 1 over the square root of each class's share of the points; 1 for a class that does not occur."""
    points = sum(np.bincount(cloud.classes, minlength=len(CLASSES)) for cloud in clouds)
    share = torch.from_numpy(points / np.sum(points)).float()
    return torch.where(share > 0, share.rsqrt(), 1)
