"""Read hazmat signs: squares in an image are rectified and classified, and squares without a sign are rejected."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pixels
from pipeline.plugins.finds.config import HazmatConfig
from pipeline.plugins.finds.patch_network import PatchNetwork
from pipeline.plugins.finds.squares import Pyramid, SquareCandidates, rectified
from pipeline.tracks.find import HAZMAT_CLASSES, Reading, is_same, overlap_ratios

SIGN = "hazmat_sign"
SIGN_SIDE = 96  # Side of a patch, pixels; the sign covers 80% of the side, so that a letter of a word has ten pixels


class HazmatReader:
    """Finds and classifies hazmat signs in any orientation."""

    def __init__(self, network: PatchNetwork, config: HazmatConfig = HazmatConfig()):
        """Read with a trained network."""
        self._network, self._config = network, config

    @classmethod
    def load(cls, weights: Path, config: HazmatConfig = HazmatConfig()) -> "HazmatReader":
        """A reader with the weights of a safetensors file; InputError as for :meth:`PatchNetwork.load`."""
        return cls(PatchNetwork.load(weights, len(HAZMAT_CLASSES), side=SIGN_SIDE), config)

    def read(self, squares: SquareCandidates) -> list[Reading]:
        """The signs among the squares of an image, the most confident first."""
        quads = squares.quads
        if not len(quads):
            return []
        patches = np.stack([rectified(squares.pyramid, quad, SIGN_SIDE) for quad in quads])
        # The mean probability over all four orientations is at least a quarter of the probability in one.
        no_sign = self._network.probabilities(patches, turns=1)[:, -1]
        likely = np.flatnonzero(self._sign_probability(no_sign / 4) > self._config.confidence)
        if not len(likely):
            return []
        found = self._signs(quads[likely], self._mean_probabilities(squares.pyramid, quads[likely]))
        return [
            Reading(SIGN, HAZMAT_CLASSES[int(classes.argmax())], quad / squares.scale, confidence)
            for quad, confidence, classes in found
        ]

    def _mean_probabilities(self, pyramid: Pyramid, quads: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, classes + 1) probabilities of N squares, each averaged over outlines of slightly different sizes."""
        middles = quads.mean(axis=1, keepdims=True)
        outlines = [np.float32(size) * (quads - middles) + middles for size in self._config.sizes]
        patches = [np.stack([rectified(pyramid, quad, SIGN_SIDE) for quad in scaled]) for scaled in outlines]
        return np.mean([self._network.probabilities(part) for part in patches], axis=0, dtype=np.float32)

    def _signs(
        self, quads: NDArray[np.float32], probabilities: NDArray[np.float32]
    ) -> Iterator[tuple[Pixels, float, NDArray[np.float32]]]:
        """Yield, for each sign, its best square, its confidence, and the mean probability of each class.

        The mean is taken over similar squares; the probabilities of the classes sum to 1.
        """
        config, left = self._config, list(probabilities[:, -1].argsort(kind="stable"))
        while left and (confidence := float(self._sign_probability(probabilities[left[0], -1]))) > config.confidence:
            best, *others = left
            alike = [best, *(k for k in others if overlap_ratios(quads[best], quads[k])[0] > config.alike)]
            votes = probabilities[alike, :-1].sum(axis=0)
            yield quads[best], confidence, votes / votes.sum()
            left = [k for k in others if not is_same(quads[best], quads[k])]

    def _sign_probability(self, no_sign: NDArray[np.floating]) -> NDArray[np.float32]:
        """Probability of a sign by Bayes' rule, given the network's probability ``no_sign`` that there is no sign."""
        return np.asarray((1 - no_sign) / (1 - no_sign + self._config.prior_odds_ratio * no_sign), np.float32)
