"""The detector of people, and of other things if its network knows them, in a camera's image."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files import read_text
from pipeline.tracks.find import KINDS, VICTIM
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
CONFIDENCE = 0.25  # Least confidence of a detection; one this low only helps to find a known victim again
SUPPRESSING_IOU = 0.45  # Intersection over union above which the less confident of two boxes is dropped
WITNESS, WITNESS_IOU = 0.05, 0.3
"""Least confidence of a box that bears witness to one of another [yolo], and least overlap of the two: so uncertain a
network sees people in hardly any image without people, and where two networks see them by chance is not the same."""
SMALLER, LARGE_BOX = 0.6, 0.15
"""Size of a second input relative to the network's own, for people who are so near that they are too large for the
network; and least length of the longer side of a box found in it, relative to the image's longer side."""


Boxes = tuple[NDArray[np.float32], NDArray[np.float32]]
"""(N, 4) boxes and their (N, classes) confidences."""


class VictimDetector:
    """Finds people, and what else its network knows, by a network of the YOLO family."""

    def __init__(
        self,
        network: DarknetNetwork,
        confidence: float = CONFIDENCE,
        make_fast: Callable[[DarknetNetwork], FusedNetwork] = FusedNetwork,
        names: Sequence[str] = (),
    ) -> None:
        """Detect people by a network.

        Args:
            network: network for images of three channels.
            confidence: least confidence of a detection, between 0 and 1.
            make_fast: turns the network into one for inference on this processor.
            names: of the network's classes; by default one of people, or those of COCO or Pascal VOC.

        Raises:
            InputError: a confidence out of range, or a network of other channels or classes.
        """
        if not 0 < confidence < 1:
            raise InputError(f"detector: confidence {confidence}: between 0 and 1")
        self._confidence, self._classes = confidence, _classes(network, names)
        *_, smallest = networks = of_both_sizes(network)
        self._networks = [make_fast(n) for n in networks]
        witnesses, upended = network.witnesses(), (smallest.cfg.height, smallest.cfg.width)
        self._upended = make_fast(witnesses.resized(*upended)) if witnesses else None

    @classmethod
    def load(cls, *files: Path, confidence: float = CONFIDENCE) -> "VictimDetector":
        """A detector from ``.cfg`` and weights, or from weights with the ``.cfg`` beside them.

        A file beside the ``.cfg`` with the ending ``.names`` has the names of the classes, one a line.

        Raises:
            InputError: as :func:`load_network`, or no class is of a kind that the robot looks for.
        """
        names = network_files(*files)[0].with_suffix(".names")
        return cls(load_network(*files), confidence, names=read_text(names).split("\n") if names.exists() else ())

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        """Things in an (H, W, 3) uint8 image of any size, the most confident first.

        Raises:
            InputError: the image is grey, empty, or of another type.
        """
        check_image(rgb)
        image, least = evenly_exposed(rgb), LARGE_BOX * max(rgb.shape)
        lying = cache(lambda: self._find_lying(image))
        parts = [self._find(self._networks[0], image, lying)]
        for network in self._networks[1:]:
            boxes, scores = self._find(network, image, lying)
            is_near = np.max(boxes[:, 2:] - boxes[:, :2], axis=1, initial=0) >= least
            parts.append((boxes[is_near], scores[is_near]))
        boxes, scores = _joined(parts)
        found = [self._best(kind, boxes, scores[:, numbers].max(axis=1)) for kind, numbers in self._classes.items()]
        return sorted((thing for one in found for thing in one), key=lambda thing: -thing.confidence)

    def _find(self, network: FusedNetwork, image: NDArray[np.uint8], lying: Callable[[], Boxes]) -> Boxes:
        """(N, 4) boxes in the image, several of each thing, and their (N, classes) confidences.

        ``lying`` finds boxes that bear witness besides those of the network itself; asked only if something has none.
        """
        parts = self._heads(network, image)
        for place, yolo in zip(network.cfg.places, network.cfg.heads, strict=True):
            if yolo.witnesses:
                boxes, scores = parts[place]
                known = _are_witnessed(boxes, _joined(parts[k] for k in yolo.witnesses))
                if (scores[~known] >= self._confidence).any():
                    known |= _are_witnessed(boxes, lying())
                parts[place] = boxes[known], scores[known]
        return _joined(parts.values())

    def _find_lying(self, image: NDArray[np.uint8]) -> Boxes:
        """Boxes of the witnesses in the image turned to either side: photos teach them few people who lie."""
        assert self._upended is not None
        parts = [(turns, self._heads(self._upended, np.rot90(image, turns))) for turns in (1, -1)]
        return _joined(
            (turned_back(b, turns, image.shape), scores) for turns, part in parts for b, scores in part.values()
        )

    def _heads(self, network: FusedNetwork, image: NDArray[np.uint8]) -> dict[int, Boxes]:
        """The boxes in the image of each [yolo], by its number, and their confidences."""
        cfg, least = network.cfg, min(self._confidence, WITNESS)
        letterbox, canvas = Letterbox.fit(image, cfg.width, cfg.height)
        parts = dict[int, Boxes]()
        for head, yolo, place in zip(network(canvas), cfg.heads, cfg.places, strict=True):
            boxes, scores = decode(head, yolo, cfg.width, cfg.height, least)
            parts[place] = letterbox.to_image(boxes), scores
        return parts

    def _best(self, kind: str, boxes: NDArray[np.float32], scores: NDArray[np.float32]) -> list[Detection]:
        good = (scores >= self._confidence) & (areas(boxes) > 0)
        boxes, scores = boxes[good], scores[good]
        kept = suppress(boxes, scores, SUPPRESSING_IOU)
        return [Detection(tuple(boxes[i].tolist()), float(scores[i]), kind) for i in kept]


def _joined(parts: Iterable[Boxes]) -> Boxes:
    boxes, scores = zip(*parts, strict=True)
    return np.concatenate(boxes), np.concatenate(scores)


def _are_witnessed(found: NDArray[np.float32], witnesses: Boxes) -> NDArray[np.bool_]:
    """(N,) bool, the boxes (N, 4) of a [yolo] where one of its witnesses sees something too."""
    boxes, scores = witnesses
    best = scores.max(axis=1, initial=0)
    sure = best >= WITNESS
    seen = boxes[sure][suppress(boxes[sure], best[sure], SUPPRESSING_IOU)]
    return np.asarray(overlaps(found, seen).max(axis=1, initial=0) > WITNESS_IOU)


def turned_back(boxes: NDArray[np.float32], turns: int, shape: Sequence[int]) -> NDArray[np.float32]:
    """(N, 4) boxes in an image of a ``shape`` (H, W, 3), of those in it turned by a quarter, 1 to the left or −1."""
    height, width, _ = shape
    x0, y0, x1, y1 = boxes.T
    return np.stack([width - y1, x0, width - y0, x1] if turns > 0 else [y0, height - x1, y1, height - x0], axis=1)


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
