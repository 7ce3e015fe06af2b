"""Trains the classifier of hazmat signs on drawn labels; see :mod:`sarsim.dataset.hazmat_patches`."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import save_file
from torch import Tensor, nn

from pipeline.files import read_bytes, whole_file
from pipeline.finds.hazmat_network import HazmatNetwork, to_input
from pipeline.frame import decoded
from sarsim.dataset.folder import Dataset
from sarsim.dataset.hazmat_patches import PatchSource, patches
from sarsim.dataset.settings import HazmatTrainingConfig

VALIDATED = 2000  # Patches on which the accuracy is measured
PHOTO_SIDE = 900  # Pixels along the longer side of a photo: squares of which are as large as signs


def pictures(data: Sequence[Path]) -> Iterator[NDArray[np.uint8]]:
    """(H, W, 3) uint8 images of all scenes of datasets, which are folders, and photos; none must show signs.

    Raises:
        InputError: one is missing or broken.
    """
    for folder in (path for path in data if not path.is_file()):
        for _, scene in Dataset(folder):
            yield from (scene.rgb(k) for k in range(len(scene)))
    for path in (path for path in data if path.is_file()):
        image = decoded(read_bytes(path), cv2.IMREAD_COLOR)[..., ::-1]
        scale = min(1.0, PHOTO_SIDE / max(image.shape))
        yield np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)


class HazmatTraining:
    """A training under way.

    Attributes:
        network: that learns.
    """

    def __init__(
        self,
        pictures: Sequence[NDArray[np.uint8]],
        config: HazmatTrainingConfig,
        network: HazmatNetwork | None = None,
    ):
        """Make the patches.

        Args:
            pictures: (H, W, 3) uint8 each, without signs.
            config: how to train.
            network: to begin with; by default one of random weights.
        """
        self._config, self._pictures = config, pictures
        self._rng = np.random.default_rng(config.seed)
        torch.manual_seed(config.seed)
        source = PatchSource.make(config.labels, pictures, self._rng)
        self._images, self._kinds = patches(source, config.bank, self._rng)
        self.network = (network or HazmatNetwork()).train().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._optimiser = torch.optim.AdamW(self.network.parameters(), config.rate, weight_decay=0.01)
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(self._optimiser, config.rate, config.steps)

    def step(self) -> None:
        """Learn from a batch of patches, turned by a random quarter."""
        chosen = self._rng.integers(len(self._images), size=self._config.batch)
        batch = torch.rot90(to_input(self._images[chosen]), int(self._rng.integers(4)), (2, 3))
        scores, kinds = self.network(batch), torch.from_numpy(self._kinds[chosen])
        loss = nn.functional.cross_entropy(scores, kinds, label_smoothing=0.02)
        self._optimiser.zero_grad()
        loss.backward()
        self._optimiser.step()
        self._schedule.step()

    def accuracy(self) -> float:
        """The share of patches of newly drawn labels that are classified rightly."""
        self.network.eval()
        source = PatchSource.make(self._config.labels // 5 + 1, self._pictures, self._rng)
        unseen, right = patches(source, VALIDATED, self._rng)
        return float((self.network.probabilities(unseen).argmax(axis=1) == right).mean())


def save_hazmat(network: HazmatNetwork, path: Path) -> None:
    """Write the weights in half precision; InputError if they cannot be written."""
    halves: dict[str, Tensor] = {name: value.half().contiguous() for name, value in network.state_dict().items()}
    with whole_file(path) as part:
        save_file(halves, part)
