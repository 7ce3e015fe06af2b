"""Detector of people in camera images, and of other objects for which the detector's network has classes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.files import read_text
from pipeline.victims.boxes import ScoredBoxes, suppress_non_maxima
from pipeline.victims.config import DetectorConfig
from pipeline.victims.darknet import DarknetNetwork
from pipeline.victims.detection import Detection
from pipeline.victims.input_image import evenly_exposed
from pipeline.victims.onnx_network import OnnxNetwork
from pipeline.victims.two_stages import TwoStageNetwork


class BoxNetwork(Protocol):
    """Finds boxes of some classes in an image."""

    @property
    def kinds(self) -> Mapping[str, Sequence[int]]:
        """Indices of the network's classes, by kind of object; other classes are ignored."""
        ...

    def find(self, image: Rgb, min_confidence: float) -> ScoredBoxes:
        """Boxes, pixels, several per object, and their (N, classes) confidences.

        The result includes all boxes with a confidence of at least ``min_confidence``.
        """
        ...


class VictimDetector:
    """Finds people with a network of the YOLO family, and other objects for which the network has classes."""

    def __init__(self, network: BoxNetwork, config: DetectorConfig = DetectorConfig()) -> None:
        """``network``: network that finds boxes; ``config``: limits that decide which boxes are detections."""
        self._network, self._config = network, config

    @classmethod
    def load(
        cls, *files: Path, names: Path | None = None, config: DetectorConfig = DetectorConfig()
    ) -> "VictimDetector":
        """A detector from the shipped ``.safetensors``, an ONNX file, or the ``.cfg`` and ``.weights`` of Darknet.

        Args:
            files: files of the network.
            names: file with the names of the network's classes, one per line; by default, a ``.names`` file next to
                the first file, if there is one.
            config: limits that decide which boxes are detections.

        Raises:
            InputError: see :meth:`TwoStageNetwork.load`, :meth:`OnnxNetwork.load` and :meth:`DarknetNetwork.load`; or
                the files are of other types.
        """
        endings = [file.suffix.lower() for file in files]
        if endings == [".safetensors"] and names is not None:
            raise InputError(f"--detector-names {names}: the shipped network finds only people; leave the names out")
        if endings == [".safetensors"]:
            return cls(TwoStageNetwork.load(files[0], config), config)
        if endings == [".onnx"]:
            return cls(OnnxNetwork.load(files[0], *_class_names(files[0], names)), config)
        if len(files) == 2 and endings[0] == ".cfg" and endings[1] not in (".safetensors", ".onnx"):
            cfg, weights = files
            return cls(DarknetNetwork.load(cfg, weights, *_class_names(cfg, names)), config)
        given = " ".join(map(str, files))
        wanted = "one .onnx or .safetensors file, or a Darknet .cfg file and its .weights file"
        raise InputError(f"--detector {given}: must be {wanted}")

    def detect(self, rgb: Rgb) -> list[Detection]:
        """Objects in an image of any size, the most confident first.

        Raises:
            InputError: the image is greyscale, empty, or of another type.
        """
        check_image(rgb)
        config = self._config
        boxes, scores = self._network.find(evenly_exposed(rgb), config.confidence)
        found: list[Detection] = []
        for kind, classes in self._network.kinds.items():
            of_kind = scores[:, list(classes)].max(axis=1)
            best = suppress_non_maxima(boxes, of_kind, config.confidence, config.suppressing_iou)
            found += [Detection(tuple(box.tolist()), float(sure), kind) for box, sure in zip(*best, strict=True)]
        return sorted(found, key=lambda detection: -detection.confidence)


def _class_names(network: Path, names: Path | None) -> tuple[list[str], str]:
    """The names of a network's classes and the file's name; the file is ``names`` or lies next to the network."""
    beside = network.with_suffix(".names")
    if names is not None:
        return read_text(names).split("\n"), str(names)
    return (read_text(beside).split("\n") if beside.exists() else []), "its .names file"


def check_image(rgb: Rgb) -> None:
    """Raise InputError unless an image is (H, W, 3), uint8 and not empty."""
    if rgb.size == 0:
        raise InputError(f"an image must have at least one pixel, but its shape is {rgb.shape}")
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise InputError(f"an image must have shape (height, width, 3), not {rgb.shape}")
    if rgb.dtype != np.uint8:
        raise InputError(f"an image must have dtype uint8, not {rgb.dtype}")
