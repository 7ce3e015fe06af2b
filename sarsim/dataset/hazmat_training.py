"""Trains the classifier of hazmat signs on drawn labels; see :mod:`sarsim.dataset.hazmat_patches`."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import cycle
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.files import read_bytes
from pipeline.finds.hazmat import SIGN_SIDE
from pipeline.finds.hazmat_classes import HAZMAT_CLASSES
from pipeline.finds.patch_network import PatchNetwork
from pipeline.frame import decoded
from sarsim.dataset.folder import Dataset
from sarsim.dataset.hazmat_patches import PatchSource, patches
from sarsim.dataset.patch_training import Patches, PatchLearner
from sarsim.dataset.settings import HazmatTrainingConfig
from sarsim.jobs.processes import connected

PHOTO_SIDE = 900  # Pixels along a photo's longer side at most, so that squares in it are as large as signs


def pictures(data: Sequence[Path]) -> Iterator[Rgb]:
    """(H, W, 3) uint8 images from datasets (folders) and photos (files), none of which may show signs.

    Raises:
        InputError: a dataset or photo is missing or broken.
    """
    for folder in (path for path in data if not path.is_file()):
        for _, scene in Dataset(folder):
            yield from (scene.rgb(k) for k in range(len(scene)))
    for path in (path for path in data if path.is_file()):
        image = decoded(read_bytes(path), cv2.IMREAD_COLOR)[..., ::-1]
        scale = min(1.0, PHOTO_SIDE / max(image.shape))
        yield np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)


class HazmatLearner(PatchLearner):
    """A classifier of signs, for which other processes draw patches."""

    config: HazmatTrainingConfig

    def __init__(
        self,
        pictures: Sequence[Rgb],
        config: HazmatTrainingConfig,
        device: torch.device,
        network: PatchNetwork | None = None,
    ):
        """Draw the first patches.

        Args:
            pictures: (H, W, 3) uint8 each, without signs.
            config: settings of the training.
            device: device on which to train.
            network: initial network; by default one with random weights.
        """
        super().__init__(config, device, lambda: network or PatchNetwork(len(HAZMAT_CLASSES), side=SIGN_SIDE))
        self.data, self._pictures = f"{len(pictures)} pictures", pictures
        self._new = _drawn(pictures, config)
        first = [next(self._new) for _ in range(-(-config.bank // config.chunk))]
        self._images, self._kinds = (np.concatenate(part) for part in zip(*first, strict=True))
        self._taken = self._oldest = 0

    def draw(self) -> Patches:
        """A random choice of the patches, all turned by the same random multiple of 90°."""
        chunk, worth = self.config.chunk, self.config.uses * self.config.chunk
        self._taken += self.config.batch
        while self._taken >= worth:
            self._taken -= worth
            rows = (self._oldest + np.arange(chunk)) % len(self._images)
            self._images[rows], self._kinds[rows] = next(self._new)
            self._oldest = (self._oldest + chunk) % len(self._images)
        chosen = self.rng.integers(len(self._images), size=self.config.batch)
        return np.rot90(self._images[chosen], int(self.rng.integers(4)), (1, 2)), self._kinds[chosen]

    def validate(self, network: PatchNetwork) -> list[float]:
        """The share of unseen patches, the same each time, that are classified correctly."""
        rng = np.random.default_rng((self.config.seed, self.config.processes))
        source = PatchSource.make(self.config.labels // 5 + 1, self._pictures, rng)
        unseen, right = patches(source, self.config.validated, rng)
        return [float((self.finished(network).probabilities(unseen).argmax(axis=1) == right).mean())]


def _drawn(pictures: Sequence[NDArray[np.uint8]], config: HazmatTrainingConfig) -> Iterator[Patches]:
    """An endless sequence of chunks of patches, from each process in turn, so that the order is always the same."""
    seeds = [(config.seed, k) for k in range(config.processes)]
    pipes = [connected(_draw, pictures, config.labels, config.chunk, seed)[1] for seed in seeds]
    for pipe in cycle(pipes):
        yield pipe.recv()


def _draw(
    pipe: Connection, pictures: Sequence[NDArray[np.uint8]], labels: int, chunk: int, seed: Sequence[int]
) -> None:
    """Draw labels, then send chunks of patches until the other end of the pipe is closed."""
    cv2.setNumThreads(1)
    rng = np.random.default_rng(seed)
    source = PatchSource.make(labels, pictures, rng)
    with suppress(BrokenPipeError):
        while True:
            pipe.send(patches(source, chunk, rng))
