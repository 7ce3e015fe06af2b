"""Trains a classifier of small square images."""

from abc import abstractmethod
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import save_file
from torch import Tensor, nn

from pipeline.files import atomic_write
from pipeline.finds.patch_network import PatchNetwork, to_input
from pipeline.semantic_map.networks.training_loop import Learner
from sarsim.dataset.settings import PatchTrainingConfig

Patches = tuple[NDArray[np.uint8], NDArray[np.int64]]
"""(N, side, side, channels) patches, and their classes (N,)."""


class PatchLearner(Learner[Patches, PatchNetwork]):
    """A classifier that learns from patches, which are drawn batch by batch.

    Attributes:
        config: settings.
        rng: random generator for all batches.
    """

    SCORES = ("accuracy",)

    def __init__(self, config: PatchTrainingConfig, device: torch.device, begin: Callable[[], PatchNetwork]):
        """``begin`` makes the initial network; it is called after seeding PyTorch's random numbers."""
        self.config, self.rng, self._drawn = config, np.random.default_rng(config.seed), 0
        torch.manual_seed(config.seed)
        self.network = begin().train().to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._device = device

    @abstractmethod
    def draw(self) -> Patches:
        """The next batch."""

    def batch(self, number: int) -> Patches:
        """The batch with this number; batches before it that were not requested are drawn and discarded."""
        for _ in range(self._drawn, number):
            self.draw()
        self._drawn = number + 1
        return self.draw()

    def loss(self, network: nn.Module, batch: Patches) -> Tensor:
        """The cross entropy."""
        patches, kinds = batch
        scores, right = network(to_input(patches, self._device)), torch.from_numpy(kinds).to(self._device)
        return nn.functional.cross_entropy(scores, right, label_smoothing=self.config.label_smoothing)

    def finished(self, network: PatchNetwork) -> PatchNetwork:
        """A copy of a network for use by the robot, on the CPU and in evaluation mode."""
        return deepcopy(network).cpu().eval()

    def write(self, network: PatchNetwork, out: Path, about: dict[str, Any]) -> None:
        """Write the weights in half precision; InputError if they cannot be written."""
        state = self.finished(network).state_dict().items()
        halves: dict[str, Tensor] = {name: value.half().contiguous() for name, value in state}
        with atomic_write(out) as part:
            save_file(halves, part)
