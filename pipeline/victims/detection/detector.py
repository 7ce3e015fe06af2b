"""The detector of people in a camera's image."""

from collections.abc import Callable
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.victims.detection.boxes import areas, decode, suppress
from pipeline.victims.detection.detection import Detection
from pipeline.victims.detection.inference import FusedNetwork
from pipeline.victims.detection.input_image import Letterbox, evenly_exposed
from pipeline.victims.detection.network import DarknetNetwork
from pipeline.victims.detection.weights import load_network

PERSON = {1: 0, 20: 14, 80: 0}
"""Number of the class ``person`` by the number of classes: victims alone, Pascal VOC, COCO."""
CONFIDENCE = 0.25  # Least confidence of a detection; one this low only helps to find a known victim again
SUPPRESSING_IOU = 0.45  # Intersection over union above which the less confident of two boxes is dropped
SMALLER, LARGE_BOX = 0.6, 0.15
"""Size of a second input relative to the network's own, for people who are so near that they are too large for the
network; and least length of the longer side of a box found in it, relative to the image's longer side."""


class VictimDetector:
    """Finds people by a network of the YOLOv3 family."""

    def __init__(
        self,
        network: DarknetNetwork,
        confidence: float = CONFIDENCE,
        make_fast: Callable[[DarknetNetwork], FusedNetwork] = FusedNetwork,
    ) -> None:
        """Detect people by a network.

        Args:
            network: network for images of three channels, with one class or the classes of COCO or Pascal VOC.
            confidence: least confidence of a detection, between 0 and 1.
            make_fast: turns the network into one for inference on this processor.

        Raises:
            InputError: a confidence out of range, or a network of other channels or classes.
        """
        if not 0 < confidence < 1:
            raise InputError(f"detector: confidence {confidence}: between 0 and 1")
        self._confidence, self._person = confidence, _person(network)
        self._networks = [make_fast(n) for n in of_both_sizes(network)]

    @classmethod
    def load(cls, cfg: Path, weights: Path, confidence: float = CONFIDENCE) -> "VictimDetector":
        """A detector from Darknet's files. InputError as :func:`load_network`."""
        return cls(load_network(cfg, weights), confidence)

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        """People in an (H, W, 3) uint8 image of any size, the most confident first.

        Raises:
            InputError: the image is grey, empty, or of another type.
        """
        check_image(rgb)
        image, least = evenly_exposed(rgb), LARGE_BOX * max(rgb.shape)
        boxes, scores = self._find(self._networks[0], image)
        for network in self._networks[1:]:
            more, their_scores = self._find(network, image)
            is_near = np.max(more[:, 2:] - more[:, :2], axis=1, initial=0) >= least
            boxes, scores = np.concatenate([boxes, more[is_near]]), np.append(scores, their_scores[is_near])
        return self._best(boxes, scores)

    def _find(
        self, network: FusedNetwork, image: NDArray[np.uint8]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(N, 4) boxes in the image, several of each person, and their (N,) confidences."""
        cfg = network.cfg
        letterbox, canvas = Letterbox.fit(image, cfg.width, cfg.height)
        parts = [
            decode(head, yolo, cfg.width, cfg.height, self._confidence)
            for head, yolo in zip(network(canvas), cfg.heads, strict=True)
        ]
        boxes = letterbox.to_image(np.concatenate([boxes for boxes, _ in parts]))
        return boxes, np.concatenate([scores[:, self._person] for _, scores in parts])

    def _best(self, boxes: NDArray[np.float32], scores: NDArray[np.float32]) -> list[Detection]:
        good = (scores >= self._confidence) & (areas(boxes) > 0)
        boxes, scores = boxes[good], scores[good]
        kept = suppress(boxes, scores, SUPPRESSING_IOU)
        return [Detection(tuple(boxes[i].tolist()), float(scores[i])) for i in kept]


def of_both_sizes(network: DarknetNetwork) -> list[DarknetNetwork]:
    """The network, and its copy for an input SMALLER times as large, unless rounding to the stride undoes that."""
    stride, cfg = network.stride, network.cfg
    width, height = (stride * ceil(SMALLER * size / stride) for size in (cfg.width, cfg.height))
    is_smaller = width < cfg.width and height < cfg.height
    return [network, network.resized(width, height)] if is_smaller else [network]


def check_image(rgb: NDArray[np.uint8]) -> None:
    """Raise InputError unless it is an (H, W, 3) uint8 image that is not empty."""
    if rgb.size == 0:
        raise InputError(f"image: empty, of shape {rgb.shape}")
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise InputError(f"image: of shape {rgb.shape}, not (height, width, 3): grey?")
    if rgb.dtype != np.uint8:
        raise InputError(f"image: {rgb.dtype} instead of uint8")


def _person(network: DarknetNetwork) -> int:
    """Number of the class ``person``."""
    classes, name = network.cfg.classes, network.cfg.name
    if network.cfg.channels != 3:
        raise InputError(f"{name}: a network for {network.cfg.channels} channels, not for colour images")
    if classes not in PERSON:
        known = ", ".join(map(str, PERSON))
        raise InputError(f"{name}: which of its {classes} classes is a person? Known are networks of {known}")
    return PERSON[classes]
