"""People in a camera's image."""

from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.victims.detection.boxes import areas, decode, suppress
from pipeline.victims.detection.darknet_cfg import DarknetCfg
from pipeline.victims.detection.detection import Detection
from pipeline.victims.detection.exposure import evenly_exposed
from pipeline.victims.detection.inference import FusedNetwork
from pipeline.victims.detection.letterbox import Letterbox
from pipeline.victims.detection.network import DarknetNetwork
from pipeline.victims.detection.weights import load_network

PERSON = {1: 0, 20: 14, 80: 0}
"""Number of the class ``person`` by how many there are: victims alone, Pascal VOC, COCO."""


@dataclass(frozen=True)
class DetectorConfig:
    """Settings of the detector.

    Attributes:
        confidence: least of a detection, between 0 and 1; so low, it tells only where someone was found before.
        overlap: intersection over union above which the less confident of two boxes is dropped.
        person: number of the class ``person``; if not given, as in COCO, Pascal VOC or a network of one class.
        smaller: size of a second input over the network's own, to find those who are so near that they are too large
            for the network; 1 for none.
        near: longer side of what counts there, over the image's, at least.
    """

    confidence: float = 0.25
    overlap: float = 0.45
    person: int | None = None
    smaller: float = 0.6
    near: float = 0.15

    def __post_init__(self) -> None:
        """Refuse what cannot be done."""
        if not (0 < self.confidence < 1 and 0 <= self.overlap <= 1):
            raise InputError(
                f"detector: confidence {self.confidence}, overlap {self.overlap}: between 0 and 1"
            )
        if not (0 < self.smaller <= 1 and 0 <= self.near <= 1):
            raise InputError(f"detector: smaller {self.smaller}, near {self.near}: between 0 and 1")


class Network(Protocol):
    """What comes out of a network for one image: see :class:`FusedNetwork`."""

    cfg: DarknetCfg

    def __call__(self, image: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
        """(anchors · (5 + classes), H, W) of each [yolo], from an (H, W, 3) image of the network's size."""
        ...


class VictimDetector:
    """Finds people by a network of the YOLOv3 family."""

    def __init__(self, network: DarknetNetwork, config: DetectorConfig | None = None) -> None:
        """By a network with these settings. InputError where it has no class ``person`` that is known."""
        self.config = config or DetectorConfig()
        self._person = _person(network, self.config)
        self._networks: list[Network] = [FusedNetwork(n) for n in of_both_sizes(network, self.config.smaller)]

    @classmethod
    def load(cls, cfg: Path, weights: Path, config: DetectorConfig | None = None) -> "VictimDetector":
        """By Darknet's files. InputError as of :func:`load_network`."""
        return cls(load_network(cfg, weights), config)

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        """People in an (H, W, 3) image of any size, the most confident first.

        Raises:
            InputError: grey, empty, or of another type.
        """
        check_image(rgb)
        image, least = evenly_exposed(rgb), self.config.near * max(rgb.shape)
        boxes, scores = self._find(self._networks[0], image)
        for network in self._networks[1:]:
            more, their_scores = self._find(network, image)
            is_near = np.max(more[:, 2:] - more[:, :2], axis=1, initial=0) >= least
            boxes, scores = np.concatenate([boxes, more[is_near]]), np.append(scores, their_scores[is_near])
        return self._best(boxes, scores)

    def _find(
        self, network: Network, image: NDArray[np.uint8]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(N, 4) boxes in the image, several of each person, and (N,) how sure each is."""
        cfg = network.cfg
        letterbox, canvas = Letterbox.fit(image, cfg.width, cfg.height)
        parts = [
            decode(head, yolo, cfg.width, cfg.height, self.config.confidence)
            for head, yolo in zip(network(canvas), cfg.heads, strict=True)
        ]
        boxes = letterbox.to_image(np.concatenate([boxes for boxes, _ in parts]))
        return boxes, np.concatenate([scores[:, self._person] for _, scores in parts])

    def _best(self, boxes: NDArray[np.float32], scores: NDArray[np.float32]) -> list[Detection]:
        good = (scores >= self.config.confidence) & (areas(boxes) > 0)
        boxes, scores = boxes[good], scores[good]
        kept = suppress(boxes, scores, self.config.overlap)
        return [Detection(tuple(boxes[i].tolist()), float(scores[i])) for i in kept]


def of_both_sizes(network: DarknetNetwork, smaller: float) -> list[DarknetNetwork]:
    """A network, and the same for an input ``smaller`` times as large; the network alone if that is no smaller."""
    stride, cfg = network.stride, network.cfg
    width, height = (stride * ceil(smaller * size / stride) for size in (cfg.width, cfg.height))
    is_smaller = width < cfg.width and height < cfg.height
    return [network, network.resized(width, height)] if is_smaller else [network]


def check_image(rgb: NDArray[np.uint8]) -> None:
    """Raise InputError unless it is an (H, W, 3) uint8 image with something in it."""
    if rgb.size == 0:
        raise InputError(f"image: empty, of shape {rgb.shape}")
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise InputError(f"image: of shape {rgb.shape}, not (height, width, 3): grey?")
    if rgb.dtype != np.uint8:
        raise InputError(f"image: {rgb.dtype} instead of uint8")


def _person(network: DarknetNetwork, config: DetectorConfig) -> int:
    classes, name = network.cfg.classes, network.cfg.name
    if network.cfg.channels != 3:
        raise InputError(f"{name}: a network for {network.cfg.channels} channels, not for colour images")
    person = PERSON.get(classes) if config.person is None else config.person
    if person is None:
        raise InputError(f"{name}: which of its {classes} classes is a person? Give its number")
    if not 0 <= person < classes:
        raise InputError(f"{name}: no class {person}, it has {classes}")
    return person
