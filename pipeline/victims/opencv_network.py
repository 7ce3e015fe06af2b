"""Networks from any source that OpenCV runs: the common part of Darknet and ONNX networks.

OpenCV trusts the files and may crash on them. Therefore a network is first tried in a separate process.
"""

import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import prod
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.files import NO_ERROR, run_isolated
from pipeline.tracks.find import KINDS, VICTIM
from pipeline.victims.boxes import ScoredBoxes
from pipeline.victims.input_image import Letterbox

PERSON_CLASSES = {1: (0, "people"), 20: (14, "Pascal VOC"), 80: (0, "COCO")}
"""For networks without class names, by number of classes: index of ``person``, and the source of the classes."""
KIND_OF = {kind: kind for kind in KINDS} | dict.fromkeys(("person", "doll"), VICTIM)
"""Kind of each known class by name, with underscores for spaces; other classes are ignored."""
SECONDS, MEMORY = 60, 3_000_000_000
"""Processor time, s, and memory, bytes, allowed for reading a network.

The memory also limits the total size of the outputs of the network's layers.
"""
CRASHED = f"OpenCV crashed on this network, or needed more than {SECONDS} s or {MEMORY / 1e9:g} GB to read it"


class OpenCvNetwork(ABC):
    """A network that OpenCV runs once per image.

    Attributes:
        kinds: indices of the network's classes, by kind of object.
        net: the network.
        size: width and height of the network's input, pixels.
        outputs: names of the layers whose outputs are decoded.
    """

    kinds: dict[str, list[int]]
    net: cv2.dnn.Net
    size: tuple[int, int]
    outputs: Sequence[str]

    @abstractmethod
    def check(self) -> None:
        """Raise InputError if the network cannot be valid; called before OpenCV first runs it."""

    @abstractmethod
    def decode(self, outputs: Sequence[Any]) -> ScoredBoxes:
        """Boxes in the input, pixels, several per object, and (N, classes) confidences, from the ``outputs``."""

    def find(self, image: Rgb, min_confidence: float) -> ScoredBoxes:
        """Boxes, pixels, that reach ``min_confidence``, several per object, and (N, classes) confidences."""
        letterbox, canvas = Letterbox.fit(image, *self.size)
        boxes, scores = self.run(canvas)
        good = scores.max(axis=1, initial=0) >= min_confidence
        return letterbox.to_image(boxes[good]), scores[good]

    def run(self, canvas: Rgb) -> ScoredBoxes:
        """Boxes in an image of the input's size; see :meth:`decode`."""
        self.net.setInput(cv2.dnn.blobFromImage(canvas, 1 / 255))
        return self.decode(self.net.forward(self.outputs))

    def output_shapes(self) -> list[list[tuple[int, ...]]]:
        """The shapes of all layers' outputs."""
        _, _, shapes = self.net.getLayersShapes([1, 3, *self.size[::-1]])
        return [[tuple(map(int, shape)) for shape in layer] for layer in shapes]


Network = TypeVar("Network", bound=OpenCvNetwork)


def checked_network(files: str, make: Callable[[], Network], remedy: str = "") -> Network:
    """Try a network in a separate process, then make the network and run it once.

    Args:
        files: the network's files, for error messages.
        make: picklable function that makes the network.
        remedy: advice at the end of the error message if OpenCV cannot run the network.

    Raises:
        InputError: OpenCV cannot run the network, or its outputs are not finite; the message names the ``files``.
    """
    said = run_isolated(_error_in, make, remedy, seconds=SECONDS, memory=MEMORY)
    if said != NO_ERROR:
        raise InputError(f"{files}: {said or CRASHED}")
    network = make()
    try:
        boxes, scores = network.run(np.full((*network.size[::-1], 3), 128, np.uint8))
    except cv2.error as error:
        raise InputError(f"{files}: {_opencv_message(error)}{remedy}") from error
    if not (np.isfinite(boxes).all() and np.isfinite(scores).all()):
        raise InputError(f"{files}: the network's outputs with these weights are not finite; use other weights")
    return network


def _error_in(make: Callable[[], OpenCvNetwork], remedy: str) -> str:
    """The error message if a network is invalid; otherwise NO_ERROR."""
    try:
        network = make()
        outputs = sum(4 * prod(shape) for layer in network.output_shapes() for shape in layer)
        network.check()
    except cv2.error as error:
        return _opencv_message(error) + remedy
    except InputError as error:
        return str(error)
    if outputs <= MEMORY:
        return NO_ERROR
    return (
        f"the network is too large: its layers take {outputs / 1e9:.2g} GB, more than {MEMORY / 1e9:g} GB; "
        "use one with a smaller input"
    )


def _opencv_message(error: cv2.error) -> str:
    return f"OpenCV cannot run this network: {' '.join(error.err.split())}"


def kinds_of(path: Path, count: int, names: Sequence[str], where: str) -> dict[str, list[int]]:
    """Indices of a network's classes, by kind of object.

    Args:
        path: file of the network.
        count: number of the network's classes.
        names: names of the classes, in order; empty if unknown.
        where: source of the names, for error messages.

    Raises:
        InputError: there are more or fewer names than classes, or none of the names is known.
    """
    words = ["_".join(word.split()).casefold() for word in names if word.strip()]
    if not words and count in PERSON_CLASSES:
        number, whose = PERSON_CLASSES[count]
        if count > 1:
            print(f"{path}: no names of its classes; assuming the {count} classes of {whose}", file=sys.stderr)
        return {VICTIM: [number]}
    if words and len(words) != count:
        raise InputError(f"{path}: the network has {count} classes, but {where} has {len(words)} names")
    kinds = [KIND_OF.get(word) for word in words]
    if not any(kinds):
        raise InputError(
            f"{path}: none of the network's {count} classes is known; "
            f"{where} must contain at least one of {', '.join(KIND_OF)}"
        )
    return {kind: [i for i, other in enumerate(kinds) if other == kind] for kind in KINDS if kind in kinds}
