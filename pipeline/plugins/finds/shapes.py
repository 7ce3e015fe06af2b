"""Recognise fire extinguishers and door levers: regions that stand out or are red are classified by a network."""

from pathlib import Path

import numpy as np

from pipeline.frame import Frame
from pipeline.plugins.finds.config import FindsConfig
from pipeline.plugins.finds.patch_network import PatchNetwork
from pipeline.plugins.finds.protrusions import Protrusions, convex_hull, square_around
from pipeline.plugins.finds.squares import Pyramid, rectified
from pipeline.tracks.find import KINDS_WITH_SHAPE, Reading, is_same


class ShapeReader:
    """Finds objects of the kinds that are recognised by their shape."""

    def __init__(self, network: PatchNetwork, config: FindsConfig = FindsConfig()):
        """Read with a trained network."""
        self._network, self._config = network, config

    @classmethod
    def load(cls, weights: Path, config: FindsConfig = FindsConfig()) -> "ShapeReader":
        """A reader with the weights of a safetensors file; InputError as for :meth:`PatchNetwork.load`."""
        return cls(PatchNetwork.load(weights, len(KINDS_WITH_SHAPE), has_relief=True), config)

    def read(self, frame: Frame) -> list[Reading]:
        """The objects recognised in a frame with sufficient confidence, the most confident first, each once."""
        seen = Protrusions.of(frame, self._config)
        if not seen.regions:
            return []
        pyramid = Pyramid(seen.picture)
        patches = np.stack([rectified(pyramid, square_around(region)) for region in seen.regions])
        probabilities = self._network.probabilities(patches, turns=1)
        found: list[Reading] = []
        for best in probabilities[:, -1].argsort(kind="stable"):
            kind, corners = int(probabilities[best, :-1].argmax()), convex_hull(seen.regions[best])
            is_sure = probabilities[best, kind] > self._config.shapes.confidence
            if is_sure and not any(is_same(corners, other.corners) for other in found):
                found.append(Reading(KINDS_WITH_SHAPE[kind], "", corners, float(probabilities[best, kind])))
        return found
