"""The detector of people, and of other kinds of objects if its network has classes of them, in a camera's image."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Mask, Rgb
from pipeline.errors import InputError
from pipeline.files import read_text
from pipeline.tracks.find import KINDS, VICTIM
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detection.boxes import areas, decode, overlaps, suppress
from pipeline.victims.detection.detection import Detection
from pipeline.victims.detection.inference import FusedNetwork
from pipeline.victims.detection.input_image import Letterbox, evenly_exposed
from pipeline.victims.detection.network import DarknetNetwork
from pipeline.victims.detection.weights import load_network, network_files

PERSON = {1: 0, 20: 14, 80: 0}
"""Number of the class ``person`` by the number of classes, if they have no names: victims, Pascal VOC, COCO."""
KIND_OF = {kind: kind for kind in KINDS} | dict.fromkeys(("person", "doll"), VICTIM)
"""Kind of the classes of networks by their names, spaces as underscores; other classes are ignored."""
Boxes = tuple[NDArray[np.float32], NDArray[np.float32]]
"""(N, 4) boxes and their (N, classes) confidences."""


class VictimDetector:
    """Finds people, and other objects that its network has classes of, by a network of the YOLO family."""

    def __init__(
        self,
        network: DarknetNetwork,
        config: DetectorConfig = DetectorConfig(),
        make_fast: Callable[[DarknetNetwork], FusedNetwork] = FusedNetwork,
        names: Sequence[str] = (),
    ) -> None:
        """Detect people by a network.

        Args:
            network: network for images of three channels.
            config: which boxes are detections.
            make_fast: turns the network into one for inference on this processor.
            names: of the network's classes; by default one of people, or those of COCO or Pascal VOC.

        Raises:
            InputError: a confidence that is not between 0 and 1, or a network of other channels or classes.
        """
        if not 0 < config.confidence < 1:
            raise InputError(f"detector: confidence {config.confidence}: between 0 and 1")
        self._config, self._classes = config, _classes(network, names)
        *_, smallest = networks = of_both_sizes(network, config.smaller)
        self._networks = [make_fast(n) for n in networks]
        witnesses, upended = network.witnesses(), (smallest.cfg.height, smallest.cfg.width)
        self._upended = make_fast(witnesses.resized(*upended)) if witnesses else None

    @classmethod
    def load(cls, *files: Path, config: DetectorConfig = DetectorConfig()) -> "VictimDetector":
        """A detector from ``.cfg`` and weights, or from weights with the ``.cfg`` beside them.

        A file beside the ``.cfg`` with the ending ``.names`` has the names of the classes, one a line.

        Raises:
            InputError: as :func:`load_network`, or no class is of a kind that the robot looks for.
        """
        names = network_files(*files)[0].with_suffix(".names")
        return cls(load_network(*files), config, names=read_text(names).split("\n") if names.exists() else ())

    def detect(self, rgb: Rgb) -> list[Detection]:
        """Objects in an image of any size, the most confident first.

        Raises:
            InputError: the image is grey, empty, or of another type.
        """
        check_image(rgb)
        config = self._config
        image, least = evenly_exposed(rgb, config.exposure), config.large_box * max(rgb.shape)
        lying = cache(lambda: self._find_lying(image))
        parts = [self._find(self._networks[0], image, lying)]
        for network in self._networks[1:]:
            boxes, scores = self._find(network, image, lying)
            is_near = np.max(boxes[:, 2:] - boxes[:, :2], axis=1, initial=0) >= least
            parts.append((boxes[is_near], scores[is_near]))
        boxes, scores = _joined(parts)
        found = [self._best(kind, boxes, scores[:, numbers].max(axis=1)) for kind, numbers in self._classes.items()]
        return sorted((detection for one in found for detection in one), key=lambda detection: -detection.confidence)

    def _find(self, network: FusedNetwork, image: Rgb, lying: Callable[[], Boxes]) -> Boxes:
        """Boxes in the image, several of each object, and their confidences.

        ``lying`` finds boxes that bear witness besides those of the network itself; asked only if a box has none.
        """
        parts = self._heads(network, image)
        for place, yolo in zip(network.cfg.places, network.cfg.heads, strict=True):
            if yolo.witnesses:
                boxes, scores = parts[place]
                witnessed = self._are_witnessed(boxes, _joined(parts[k] for k in yolo.witnesses))
                if (scores[~witnessed] >= self._config.confidence).any():
                    witnessed |= self._are_witnessed(boxes, lying())
                parts[place] = boxes[witnessed], scores[witnessed]
        return _joined(parts.values())

    def _find_lying(self, image: Rgb) -> Boxes:
        """Boxes of the witnesses in the image turned to either side: photos teach them few people who lie."""
        assert self._upended is not None
        parts = [(turns, self._heads(self._upended, np.rot90(image, turns))) for turns in (1, -1)]
        return _joined(
            (turned_back(b, turns, image.shape), scores) for turns, part in parts for b, scores in part.values()
        )

    def _heads(self, network: FusedNetwork, image: Rgb) -> dict[int, Boxes]:
        """The boxes in the image of each [yolo], by its number, and their confidences."""
        cfg, least = network.cfg, min(self._config.confidence, self._config.witness)
        letterbox, canvas = Letterbox.fit(image, cfg.width, cfg.height)
        parts = dict[int, Boxes]()
        for head, yolo, place in zip(network(canvas), cfg.heads, cfg.places, strict=True):
            boxes, scores = decode(head, yolo, cfg.width, cfg.height, least)
            parts[place] = letterbox.to_image(boxes), scores
        return parts

    def _are_witnessed(self, found: NDArray[np.float32], witnesses: Boxes) -> Mask:
        """Which boxes (N, 4) of a [yolo] are where one of its witnesses sees something too."""
        boxes, scores = witnesses
        best = scores.max(axis=1, initial=0)
        sure = best >= self._config.witness
        seen = boxes[sure][self._suppress(boxes[sure], best[sure])]
        return np.asarray(overlaps(found, seen).max(axis=1, initial=0) > self._config.witness_iou)

    def _suppress(self, boxes: NDArray[np.float32], scores: NDArray[np.float32]) -> NDArray[np.intp]:
        return suppress(boxes, scores, self._config.suppressing_iou, self._config.most_boxes)

    def _best(self, kind: str, boxes: NDArray[np.float32], scores: NDArray[np.float32]) -> list[Detection]:
        good = (scores >= self._config.confidence) & (areas(boxes) > 0)
        boxes, scores = boxes[good], scores[good]
        kept = self._suppress(boxes, scores)
        return [Detection(tuple(boxes[i].tolist()), float(scores[i]), kind) for i in kept]


def _joined(parts: Iterable[Boxes]) -> Boxes:
    boxes, scores = zip(*parts, strict=True)
    return np.concatenate(boxes), np.concatenate(scores)


def turned_back(boxes: NDArray[np.float32], turns: int, shape: Sequence[int]) -> NDArray[np.float32]:
    """(N, 4) boxes in an image of a ``shape`` (H, W, 3), of those in it turned by a quarter, 1 to the left or −1."""
    height, width, _ = shape
    x0, y0, x1, y1 = boxes.T
    return np.stack([width - y1, x0, width - y0, x1] if turns > 0 else [y0, height - x1, y1, height - x0], axis=1)


def of_both_sizes(network: DarknetNetwork, smaller: float) -> list[DarknetNetwork]:
    """The network, and its copy for an input ``smaller`` times as large unless rounding to the stride undoes it."""
    stride, cfg = network.stride, network.cfg
    width, height = (stride * ceil(smaller * size / stride) for size in (cfg.width, cfg.height))
    is_smaller = width < cfg.width and height < cfg.height
    return [network, network.resized(width, height)] if is_smaller else [network]


def check_image(rgb: Rgb) -> None:
    """Raise InputError unless it is an (H, W, 3) uint8 image that is not empty."""
    if rgb.size == 0:
        raise InputError(f"image: empty, of shape {rgb.shape}")
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise InputError(f"image: of shape {rgb.shape}, not (height, width, 3): grey?")
    if rgb.dtype != np.uint8:
        raise InputError(f"image: {rgb.dtype} instead of uint8")


def _classes(network: DarknetNetwork, names: Sequence[str]) -> dict[str, list[int]]:
    """Numbers of the network's classes by their kind."""
    count, name = network.cfg.classes, network.cfg.name
    if network.cfg.channels != 3:
        raise InputError(f"{name}: a network for {network.cfg.channels} channels, not for colour images")
    if not names and count in PERSON:
        return {VICTIM: [PERSON[count]]}
    words = ["_".join(word.split()) for word in names if word.strip()]
    if words and len(words) != count:
        raise InputError(f"{name}: {count} classes, but {len(words)} names")
    kinds = [KIND_OF.get(word) for word in words]
    if not any(kinds):
        raise InputError(
            f"{name}: which of its {count} classes is a person? Beside it, .names has none of {', '.join(KIND_OF)}"
        )
    return {kind: [i for i, other in enumerate(kinds) if other == kind] for kind in KINDS if kind in kinds}
