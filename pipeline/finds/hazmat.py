"""Reads hazmat signs: squares in the image are rectified and classified, and what is no sign is rejected."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.finds.find import Reading
from pipeline.finds.hazmat_classes import HAZMAT_CLASSES
from pipeline.finds.patch_network import PATCH, SURROUNDINGS, PatchNetwork
from pipeline.finds.pictures import bounded
from pipeline.finds.quads import find_quads

SIGN = "hazmat_sign"


class HazmatReader:
    """Finds hazmat signs and tells their classes, whichever way up they hang."""

    def __init__(self, network: PatchNetwork):
        """Read by a trained network."""
        self._network = network

    @classmethod
    def load(cls, weights: Path) -> "HazmatReader":
        """A reader with the weights of a safetensors file; InputError as :meth:`PatchNetwork.load`."""
        return cls(PatchNetwork.load(weights, len(HAZMAT_CLASSES)))

    def read(self, rgb: NDArray[np.uint8]) -> list[Reading]:
        """The signs in an image, (H, W, 3) or grey (H, W) uint8, the surest first.

        Raises:
            InputError: the image is empty or of another type.
        """
        image, scale = bounded(rgb)
        quads = find_quads(image)
        if not len(quads):
            return []
        patches = np.stack([rectified(image, quad) for quad in quads])
        likely = np.flatnonzero(self._network.probabilities(patches, turns=1)[:, -1] < 1 - HOPEFUL)
        if not len(likely):
            return []
        quads, chances = quads[likely], self._network.probabilities(patches[likely])
        found = _signs(quads, chances)
        return [
            Reading(SIGN, HAZMAT_CLASSES[int(classes.argmax())], quad / scale, sure) for quad, sure, classes in found
        ]


RARER = 9
"""Odds of a sign among the patches that were learned, over those among the squares of a camera's image: chosen by the
photos of boards and rooms on which its figures are given, so these flatter it."""
HOPEFUL = 0.1
"""Probability of a sign, the square one way up, from which it is looked at all four ways."""


def rectified(image: NDArray[np.uint8], quad: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(PATCH, PATCH, 3) uint8 a quadrilateral of (4, 2) corners, pixels, as a square with a margin."""
    low, high = SURROUNDINGS * PATCH, (1 - SURROUNDINGS) * PATCH
    target = np.array([[low, low], [high, low], [high, high], [low, high]], np.float32)
    T = cv2.getPerspectiveTransform(quad, target)
    shrunk = PATCH / max(*cv2.boundingRect(quad)[2:], PATCH)
    if shrunk < 1 / 2:  # by areas, for a perspective transform takes single pixels
        size = max(1, round(shrunk * image.shape[1] * 2)), max(1, round(shrunk * image.shape[0] * 2))
        part = np.diag([image.shape[1] / size[0], image.shape[0] / size[1], 1])
        image, T = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8), T @ part
    return np.asarray(cv2.warpPerspective(image, T, (PATCH, PATCH), borderMode=cv2.BORDER_REPLICATE), np.uint8)


def _signs(
    quads: NDArray[np.float32], chances: NDArray[np.float32]
) -> Iterator[tuple[NDArray[np.float32], float, NDArray[np.float32]]]:
    """The surest square of each sign, how sure it is, and the shares of the classes in it and in those alike."""
    left = list(chances[:, -1].argsort(kind="stable"))
    while left and (sure := _sureness(chances[left[0], -1])) > 1 / 2:
        best, *others = left
        alike = [best, *(k for k in others if _overlap(quads[best], quads[k])[0] > 1 / 2)]
        votes = chances[alike, :-1].sum(axis=0)
        yield quads[best], sure, votes / votes.sum()
        left = [k for k in others if not is_same(quads[best], quads[k])]


def _sureness(no_sign: float) -> float:
    """Probability of a sign by Bayes, given the network's of none."""
    return float((1 - no_sign) / (1 - no_sign + RARER * no_sign))


def is_same(one: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """Whether more than half of the smaller of two quadrilaterals, (4, 2) pixels, lies in the other."""
    return _overlap(one, other)[1] > 1 / 2


def _overlap(one: NDArray[np.float32], other: NDArray[np.float32]) -> tuple[float, float]:
    """The area that two quadrilaterals share, over that of both together, and over that of the smaller one."""
    common, _ = cv2.intersectConvexConvex(cv2.convexHull(one), cv2.convexHull(other))
    areas = cv2.contourArea(one), cv2.contourArea(other)
    return common / max(sum(areas) - common, 1), common / max(min(areas), 1)
