"""Trains the classifier of extinguishers and levers on protrusions in rendered arenas."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pipeline.errors import InputError
from pipeline.finds.config import ShapesConfig
from pipeline.finds.patch_network import PatchNetwork, to_input
from pipeline.finds.protrusions import Protrusions, square_around
from pipeline.finds.squares import Pyramid, rectified
from pipeline.tracks.config import LikelihoodConfig
from pipeline.tracks.find import SHAPED
from sarsim.dataset.folder import Dataset
from sarsim.dataset.hazmat_patches import photographed
from sarsim.dataset.patch_training import Patches, PatchLearner
from sarsim.dataset.scene_file import Scene
from sarsim.dataset.settings import ShapeTrainingConfig


class ShapePatches:
    """Patches of the protrusions in datasets.

    Attributes:
        images: (N, PATCH, PATCH, 4) uint8.
        kinds: (N,) int64 classes; ``len(SHAPED)`` means another protrusion.
    """

    def __init__(self, folders: Sequence[Path], rng: np.random.Generator, varied: ShapeTrainingConfig | None = None):
        """One patch per protrusion; with ``varied``, at random offsets, and ``copies`` of each lever or extinguisher.

        Raises:
            InputError: a dataset is missing or broken.
        """
        copies = varied.copies if varied else 1
        made = [
            (rectified(Pyramid(seen.picture), _moved(square, rng, varied) if varied else square), kind)
            for folder in folders
            for _, scene in Dataset(folder)
            for seen, region, kind in _labelled(scene)
            for square in [square_around(region)] * (copies if kind < len(SHAPED) else 1)
        ]
        self.kinds = np.array([kind for _, kind in made], np.int64)
        if missing := set(range(len(SHAPED) + 1)) - set(self.kinds.tolist()):
            kind = (*SHAPED, "other protrusion")[missing.pop()]
            raise InputError(
                f"{' '.join(map(str, folders))}: no frame shows an object of the kind {kind}; add more datasets"
            )
        self.images = np.stack([image for image, _ in made])


class ShapeLearner(PatchLearner):
    """A classifier of shapes, trained on equally many patches of each class, on average."""

    def __init__(
        self,
        known: ShapePatches,
        usual: ShapePatches,
        config: ShapeTrainingConfig,
        device: torch.device,
        network: PatchNetwork | None = None,
    ):
        """Learn from the patches ``known``; validate and calibrate with the ``usual`` ones.

        Args:
            known, usual: patches; the classes of ``usual`` are as frequent as where the robot drives.
            config: settings of the training.
            device: device on which to train.
            network: initial network; by default one with random weights.
        """
        super().__init__(config, device, lambda: network or PatchNetwork(len(SHAPED), has_relief=True))
        self._known, self._usual = known, usual
        self.data = f"{len(known.kinds)} {len(usual.kinds)} patches"
        self._of_kind = [np.flatnonzero(known.kinds == kind) for kind in range(len(SHAPED) + 1)]

    def draw(self) -> Patches:
        """Random patches with photographic variations, every other one mirrored."""
        kinds = self.rng.integers(len(self._of_kind), size=self.config.batch)
        images = np.stack([self._known.images[self.rng.choice(self._of_kind[kind])] for kind in kinds])
        images[..., :3] = [photographed(image, self.rng) for image in images[..., :3]]
        images[::2] = images[::2, :, ::-1]
        return images, kinds

    def finished(self, network: PatchNetwork) -> PatchNetwork:
        """A calibrated copy of the network for use by the robot."""
        result = super().finished(network)
        calibrate(result, self._usual)
        return result

    def validate(self, network: PatchNetwork) -> list[float]:
        """The share of the usual patches that are classified correctly."""
        counts = self.confusion(network)
        return [float(np.trace(counts) / counts.sum())]

    def confusion(self, network: PatchNetwork) -> NDArray[np.int64]:
        """The (classes, classes) confusion matrix of the usual patches; rows are true, columns predicted classes."""
        likeliest = self.finished(network).probabilities(self._usual.images, turns=1).argmax(axis=1)
        counts = np.zeros((len(SHAPED) + 1,) * 2, np.int64)
        np.add.at(counts, (self._usual.kinds, likeliest), 1)
        return counts


def calibrate(network: PatchNetwork, usual: ShapePatches) -> None:
    """Scale the scores (Guo et al., ICML 2017), and shift them, to maximise the likelihood of the usual patches.

    The classes are equally frequent in training, but not where the robot drives.
    """
    last, kinds = network.eval()[-1], torch.from_numpy(usual.kinds)
    assert isinstance(last, nn.Linear)
    with torch.no_grad():
        scores = network(to_input(usual.images))
    scale, shift = torch.ones(1, requires_grad=True), torch.zeros(scores.shape[1], requires_grad=True)
    optimiser = torch.optim.LBFGS([scale, shift], max_iter=100)

    def loss() -> Tensor:
        optimiser.zero_grad()
        value = nn.functional.cross_entropy(scale * scores + shift, kinds)
        value.backward()
        return value

    optimiser.step(loss)
    with torch.no_grad():
        last.weight *= scale
        last.bias.mul_(scale).add_(shift)


def _labelled(scene: Scene) -> list[tuple[Protrusions, NDArray[np.int64], int]]:
    """Each protrusion in a scene: its frame's protrusions, its region (N, 2), and the class of most of its pixels."""
    kinds = [
        next((k for k, kind in enumerate(SHAPED) if name.startswith(kind)), len(SHAPED))
        for name in scene.content.geom_name
    ]
    of_geom, found = np.array([*kinds, len(SHAPED)]), []  # the last element is for no geom, -1
    for frame in scene:
        assert frame.instance is not None
        seen = Protrusions.of(frame, ShapesConfig(), LikelihoodConfig())
        for region in seen.regions:
            shown = of_geom[frame.instance[tuple(region.T)]]
            found.append((seen, region, int(np.bincount(shown).argmax())))
    return found


def _moved(square: NDArray[np.float32], rng: np.random.Generator, config: ShapeTrainingConfig) -> NDArray[np.float32]:
    """A square (4, 2) scaled and shifted at random, as if its object were seen only in part."""
    middle, side = square.mean(axis=0), np.ptp(square[:, 0])
    scaled = (square - middle) * np.exp(config.larger * rng.normal())
    return (scaled + middle + config.off * side * rng.normal(size=2)).astype(np.float32)
