"""Trains a classifier of small square pictures."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import save_file
from torch import Tensor, nn

from pipeline.files import whole_file
from pipeline.finds.patch_network import PatchNetwork, to_input
from sarsim.dataset.settings import PatchTrainingConfig


class PatchTraining(ABC):
    """A training under way.

    Attributes:
        network: that learns, on a GPU if there is one.
        rng: of all that is drawn.
    """

    def __init__(self, config: PatchTrainingConfig, begin: Callable[[], PatchNetwork]):
        """``begin`` makes the network to begin with, once its random numbers have their seed."""
        self.rng, self._size = np.random.default_rng(config.seed), config.batch
        torch.manual_seed(config.seed)
        self._device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.network = begin().train().to(self._device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._optimiser = torch.optim.AdamW(self.network.parameters(), config.rate, weight_decay=0.01)
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(self._optimiser, config.rate, config.steps)

    @abstractmethod
    def batch(self, size: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Some (size, PATCH, PATCH, channels) patches to learn from, and their classes (size,)."""

    def step(self) -> None:
        """Learn from a batch."""
        patches, kinds = self.batch(self._size)
        scores, right = self.network(to_input(patches, self._device)), torch.from_numpy(kinds).to(self._device)
        loss = nn.functional.cross_entropy(scores, right, label_smoothing=0.02)
        self._optimiser.zero_grad()
        loss.backward()
        self._optimiser.step()
        self._schedule.step()


def save_patch_network(network: PatchNetwork, path: Path) -> None:
    """Write the weights in half precision; InputError if they cannot be written."""
    halves: dict[str, Tensor] = {name: value.half().contiguous() for name, value in network.state_dict().items()}
    with whole_file(path) as part:
        save_file(halves, part)
