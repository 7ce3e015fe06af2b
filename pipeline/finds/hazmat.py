"""Reads hazmat signs: squares in the image are rectified and classified, and what is no sign is rejected."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.finds.hazmat_classes import HAZMAT_CLASSES
from pipeline.finds.patch_network import PatchNetwork
from pipeline.finds.squares import Squares, is_same, overlap, rectified
from pipeline.tracks.find import Reading

SIGN = "hazmat_sign"
SIGN_SIDE = 96  # Pixels along a patch, of which eight in ten are the sign: ten for each of a word's letters


class HazmatReader:
    """Finds hazmat signs and their classes, whichever way up they hang."""

    def __init__(self, network: PatchNetwork):
        """Read by a trained network."""
        self._network = network

    @classmethod
    def load(cls, weights: Path) -> "HazmatReader":
        """A reader with the weights of a safetensors file; InputError as :meth:`PatchNetwork.load`."""
        return cls(PatchNetwork.load(weights, len(HAZMAT_CLASSES), side=SIGN_SIDE))

    def read(self, squares: Squares) -> list[Reading]:
        """The signs among the squares of an image, the surest first."""
        quads = squares.quads
        if not len(quads):
            return []
        patches = np.stack([rectified(squares.image, quad, SIGN_SIDE) for quad in quads])
        # Of the mean over all four ways up, this one is a quarter.
        one_way_up = self._network.probabilities(patches, turns=1)[:, -1]
        likely = np.flatnonzero(_sureness(one_way_up / 2**2) > 1 / 2)
        if not len(likely):
            return []
        quads, chances = quads[likely], self._network.probabilities(patches[likely])
        found = _signs(quads, chances)
        return [
            Reading(SIGN, HAZMAT_CLASSES[int(classes.argmax())], quad / squares.scale, sure)
            for quad, sure, classes in found
        ]


RARER = 9
"""Odds of a sign among the patches that were learned, over those among the squares of a camera's image: chosen by the
photos of boards and rooms on which its figures are given, for earlier weights."""


def _signs(
    quads: NDArray[np.float32], chances: NDArray[np.float32]
) -> Iterator[tuple[NDArray[np.float32], float, NDArray[np.float32]]]:
    """The surest square of each sign, how sure it is, and the shares of the classes in it and in those alike."""
    left = list(chances[:, -1].argsort(kind="stable"))
    while left and (sure := float(_sureness(chances[left[0], -1]))) > 1 / 2:
        best, *others = left
        alike = [best, *(k for k in others if overlap(quads[best], quads[k])[0] > 1 / 2)]
        votes = chances[alike, :-1].sum(axis=0)
        yield quads[best], sure, votes / votes.sum()
        left = [k for k in others if not is_same(quads[best], quads[k])]


def _sureness(no_sign: NDArray[np.floating]) -> NDArray[np.float32]:
    """Probability of a sign by Bayes, given the network's of none."""
    return np.asarray((1 - no_sign) / (1 - no_sign + RARER * no_sign), np.float32)
