"""All readers of finds together: from a frame to what it shows."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.finds.codes import CodeReader
from pipeline.finds.find import FIND_KINDS, Reading, box_corners
from pipeline.finds.hazmat import SIGN, HazmatReader, is_same
from pipeline.finds.heat import warm_regions
from pipeline.frame import Frame


class Detected(Protocol):
    """A box of a detector; see :class:`pipeline.finds.victims.detection.detection.Detection`."""

    @property
    def box(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 in pixels."""
        ...

    @property
    def confidence(self) -> float:
        """0 to 1."""
        ...

    @property
    def kind(self) -> str:
        """What it is, in the words of report.json."""
        ...


class FindReaders:
    """Reads signs, codes and heat, and takes over what a detector has found."""

    def __init__(self, hazmat: HazmatReader):
        """With a reader of hazmat signs."""
        self._hazmat, self._codes = hazmat, CodeReader()

    @classmethod
    def load(cls, hazmat: Path) -> "FindReaders":
        """With the weights of the classifier of hazmat signs; InputError as :meth:`HazmatReader.load`."""
        return cls(HazmatReader.load(hazmat))

    def read(self, frame: Frame, detections: Sequence[Detected]) -> list[Reading]:
        """What a frame shows, given a detector's boxes in its image."""
        heat = [] if frame.thermal is None else list(warm_regions(frame.thermal, len(frame.rgb)))
        return [*self.read_image(frame.rgb, detections), *heat]

    def glance(self, frame: Frame) -> list[Reading]:
        """What a frame shows that is seen in passing: codes are not enlarged as much, and no detector is asked."""
        return [*self._hazmat.read(frame.rgb), *self._codes.read(frame.rgb, enlarged=2)]

    def read_image(self, rgb: NDArray[np.uint8], detections: Sequence[Detected]) -> list[Reading]:
        """What an image shows, (H, W, 3) or grey (H, W) uint8; a detector's boxes of people are left alone.

        Raises:
            InputError: the image is empty or of another type.
        """
        others = [d for d in detections if d.kind in FIND_KINDS]
        signs = self._hazmat.read(rgb)
        boxes = [Reading(d.kind, "", box_corners(d.box), d.confidence) for d in others]
        unread = [b for b in boxes if b.kind != SIGN or not any(is_same(b.corners, s.corners) for s in signs)]
        return [*signs, *self._codes.read(rgb), *unread]
