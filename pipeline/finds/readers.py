"""All readers of finds together, which turn a frame into readings of what it shows."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.finds.codes import CodeReader
from pipeline.finds.config import FindsConfig
from pipeline.finds.hazmat import HazmatReader
from pipeline.finds.heat import warm_regions
from pipeline.finds.shapes import ShapeReader
from pipeline.finds.squares import Squares, is_same
from pipeline.frame import Frame
from pipeline.tracks.config import LikelihoodConfig
from pipeline.tracks.find import FIND_KINDS, Reading, box_corners
from pipeline.victims.detection.detection import Detection


class FindReader(Protocol):
    """Finds objects of some kinds in a frame; users may write their own."""

    def read(self, frame: Frame, detections: Sequence[Detection]) -> list[Reading]:
        """What a frame shows, given a detector's boxes in its image; may be called in another thread."""
        ...


class SeveralReaders:
    """Combines several readers; of an object that several find, the first one's reading counts."""

    def __init__(self, readers: Sequence[FindReader]):
        """``readers``: in the order in which they read."""
        self._readers = readers

    def read(self, frame: Frame, detections: Sequence[Detection]) -> list[Reading]:
        """What a frame shows, given a detector's boxes in its image."""
        found: list[Reading] = []
        for reader in self._readers:
            found += _others(reader.read(frame, detections), found)
        return found


class FindReaders:
    """Reads signs, codes, shapes and heat, and takes over what a detector has found."""

    def __init__(self, hazmat: HazmatReader, shapes: ShapeReader, config: FindsConfig = FindsConfig()):
        """``hazmat``: reads hazmat signs; ``shapes``: reads extinguishers and levers."""
        self._hazmat, self._shapes, self._codes = hazmat, shapes, CodeReader(config.codes)
        self._config = config

    @classmethod
    def load(
        cls,
        hazmat: Path,
        shapes: Path,
        config: FindsConfig = FindsConfig(),
        likelihood: LikelihoodConfig = LikelihoodConfig(),
    ) -> "FindReaders":
        """Readers with the weights of both classifiers; InputError as for :meth:`HazmatReader.load`."""
        shape_reader = ShapeReader.load(shapes, config.shapes, likelihood)
        return cls(HazmatReader.load(hazmat, config.hazmat), shape_reader, config)

    def read(self, frame: Frame, detections: Sequence[Detection]) -> list[Reading]:
        """What a frame shows, given a detector's boxes in its image."""
        thermal, config = frame.thermal, self._config.heat
        heat = [] if thermal is None else warm_regions(thermal, len(frame.rgb), config)
        shapes = self._shapes.read(frame)
        squares = Squares.of(frame.rgb, self._config.squares).fitting(frame, self._config.squares)
        return [*shapes, *_others(self._read(squares, detections), shapes), *heat]

    def read_image(self, rgb: NDArray[np.uint8], detections: Sequence[Detection]) -> list[Reading]:
        """What an image shows, (H, W, 3) or grey (H, W) uint8; a detector's boxes of people are ignored.

        Raises:
            InputError: the image is empty or of another type.
        """
        return self._read(Squares.of(rgb, self._config.squares), detections)

    def _read(self, squares: Squares, detections: Sequence[Detection]) -> list[Reading]:
        others = [d for d in detections if d.kind in FIND_KINDS]
        signs = self._hazmat.read(squares)
        boxes = [Reading(d.kind, "", box_corners(d.box), d.confidence) for d in others]
        return [*signs, *self._codes.read(squares), *_others(boxes, signs)]


def _others(readings: Sequence[Reading], read: Sequence[Reading]) -> list[Reading]:
    """The readings of objects other than those already ``read``."""
    return [r for r in readings if not any(r.kind == k.kind and is_same(r.corners, k.corners) for k in read)]
