"""The detector of people in camera images, and of other objects for which its network has classes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detection.boxes import Boxes, areas, suppress
from pipeline.victims.detection.darknet import DarknetNetwork
from pipeline.victims.detection.detection import Detection
from pipeline.victims.detection.input_image import evenly_exposed
from pipeline.victims.detection.two_stages import TwoStages


class BoxNetwork(Protocol):
    """Finds boxes of some classes in an image."""

    @property
    def kinds(self) -> Mapping[str, Sequence[int]]:
        """Indices of its classes, by kind of object; other classes are ignored."""
        ...

    def find(self, image: Rgb, least: float) -> Boxes:
        """Boxes in the image, pixels, several per object, including all with a confidence of at least ``least``."""
        ...


class VictimDetector:
    """Finds people, and other objects for which its network has classes, with a network of the YOLO family."""

    def __init__(self, network: BoxNetwork, config: DetectorConfig = DetectorConfig()) -> None:
        """Detect with a network; InputError for a minimum confidence that is not between 0 and 1."""
        if not 0 < config.confidence < 1:
            raise InputError(f"detector: confidence = {config.confidence:g}: must be greater than 0 and less than 1")
        self._network, self._config = network, config

    @classmethod
    def load(cls, *files: Path, config: DetectorConfig = DetectorConfig()) -> "VictimDetector":
        """A detector from the shipped ``.safetensors``, or from the ``.cfg`` and ``.weights`` of any Darknet network.

        A ``.names`` file next to the ``.cfg`` holds the names of the classes, one per line.

        Raises:
            InputError: see :meth:`TwoStages.load` and :meth:`DarknetNetwork.load`; or the files are of other types.
        """
        match [file.suffix for file in files]:
            case [".safetensors"]:
                return cls(TwoStages.load(files[0], config), config)
            case [".cfg", ending] if ending != ".safetensors":
                return cls(DarknetNetwork.load(*files), config)
        names = " ".join(map(str, files))
        raise InputError(
            f"--detector {names}: must be one .safetensors file, or a Darknet .cfg file and its .weights file"
        )

    def detect(self, rgb: Rgb) -> list[Detection]:
        """Objects in an image of any size, the most confident first.

        Raises:
            InputError: the image is greyscale, empty, or of another type.
        """
        check_image(rgb)
        config = self._config
        boxes, scores = self._network.find(evenly_exposed(rgb, config.exposure), config.confidence)
        kinds = self._network.kinds.items()
        found = [self._best(kind, boxes, scores[:, list(numbers)].max(axis=1)) for kind, numbers in kinds]
        return sorted((detection for one in found for detection in one), key=lambda detection: -detection.confidence)

    def _best(self, kind: str, boxes: NDArray[np.float32], scores: NDArray[np.float32]) -> list[Detection]:
        good = (scores >= self._config.confidence) & (areas(boxes) > 0)
        boxes, scores = boxes[good], scores[good]
        kept = suppress(boxes, scores, self._config.suppressing_iou, self._config.most_boxes)
        return [Detection(tuple(boxes[i].tolist()), float(scores[i]), kind) for i in kept]


def check_image(rgb: Rgb) -> None:
    """Raise InputError unless an image is (H, W, 3), uint8 and not empty."""
    if rgb.size == 0:
        raise InputError(f"an image must have at least one pixel, but its shape is {rgb.shape}")
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise InputError(f"an image must have shape (height, width, 3), not {rgb.shape}")
    if rgb.dtype != np.uint8:
        raise InputError(f"an image must have dtype uint8, not {rgb.dtype}")
