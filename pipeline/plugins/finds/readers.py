"""All readers of finds, combined to extract the readings from a frame."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.plugins.finds.codes import CodeReader
from pipeline.plugins.finds.config import FindsConfig
from pipeline.plugins.finds.hazmat import HazmatReader
from pipeline.plugins.finds.shapes import ShapeReader
from pipeline.plugins.finds.squares import SquareCandidates
from pipeline.tracks.find import FIND_KINDS, Reading, box_corners
from pipeline.victims.detection import Detection
from pipeline.victims.readers import not_among


class FindReaders:
    """Reads signs, codes and shapes, and adopts the finds of a detector.

    Attributes:
        kinds: tracking parameters of each kind of find.
    """

    def __init__(self, hazmat: HazmatReader, shapes: ShapeReader, config: FindsConfig = FindsConfig()):
        """Combine a reader of hazmat signs and a reader of extinguishers and levers with a reader of codes."""
        self._hazmat, self._shapes, self._codes = hazmat, shapes, CodeReader(config.codes)
        self._config, self.kinds = config, config.kinds

    @classmethod
    def load(cls, hazmat: Path, shapes: Path, config: FindsConfig = FindsConfig()) -> "FindReaders":
        """Readers with the weights of both classifiers, two safetensors files.

        Raises:
            InputError: a file is missing or damaged, or belongs to another network.
        """
        shape_reader = ShapeReader.load(shapes, config)
        return cls(HazmatReader.load(hazmat, config.hazmat), shape_reader, config)

    def read(self, frame: Frame, detections: Sequence[Detection]) -> list[Reading]:
        """The readings in a frame, given a detector's boxes in its image."""
        shapes = self._shapes.read(frame)
        squares = SquareCandidates.of(frame.rgb, self._config.squares).of_plausible_size(frame, self._config.squares)
        return [*shapes, *not_among(self._read(squares, detections), shapes)]

    def read_image(self, rgb: NDArray[np.uint8], detections: Sequence[Detection]) -> list[Reading]:
        """The readings in an image, (H, W, 3) or grey (H, W) uint8; a detector's boxes of people are ignored.

        Raises:
            InputError: the image is empty or of another type.
        """
        return self._read(SquareCandidates.of(rgb, self._config.squares), detections)

    def _read(self, squares: SquareCandidates, detections: Sequence[Detection]) -> list[Reading]:
        others = [d for d in detections if d.kind in FIND_KINDS]
        signs = self._hazmat.read(squares)
        boxes = [Reading(d.kind, "", box_corners(d.box), d.confidence) for d in others]
        return [*signs, *self._codes.read(squares), *not_among(boxes, signs)]
