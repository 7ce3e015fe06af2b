"""Trains the classifier of hazmat signs on drawn labels; see :mod:`sarsim.dataset.hazmat_patches`."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.files import read_bytes
from pipeline.finds.hazmat_classes import HAZMAT_CLASSES
from pipeline.finds.patch_network import PatchNetwork
from pipeline.frame import decoded
from sarsim.dataset.folder import Dataset
from sarsim.dataset.hazmat_patches import PatchSource, patches
from sarsim.dataset.patch_training import PatchTraining
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


class HazmatTraining(PatchTraining):
    """A training under way."""

    def __init__(
        self, pictures: Sequence[NDArray[np.uint8]], config: HazmatTrainingConfig, network: PatchNetwork | None = None
    ):
        """Make the patches.

        Args:
            pictures: (H, W, 3) uint8 each, without signs.
            config: how to train.
            network: to begin with; by default one of random weights.
        """
        super().__init__(config, lambda: network or PatchNetwork(len(HAZMAT_CLASSES)))
        self._labels, self._pictures = config.labels, pictures
        source = PatchSource.make(config.labels, pictures, self.rng)
        self._images, self._kinds = patches(source, config.bank, self.rng)

    def batch(self, size: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Some (size, PATCH, PATCH, 3) of the patches, turned by a random quarter, and their classes (size,)."""
        chosen = self.rng.integers(len(self._images), size=size)
        return np.rot90(self._images[chosen], int(self.rng.integers(4)), (1, 2)), self._kinds[chosen]

    def accuracy(self) -> float:
        """The share of patches of newly drawn labels that are classified rightly."""
        self.network.eval()
        source = PatchSource.make(self._labels // 5 + 1, self._pictures, self.rng)
        unseen, right = patches(source, VALIDATED, self.rng)
        return float((self.network.probabilities(unseen).argmax(axis=1) == right).mean())
