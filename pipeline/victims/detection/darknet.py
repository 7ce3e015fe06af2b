"""Darknet networks from any source, which OpenCV reads, runs and decodes.

OpenCV trusts the files: it reads missing weights as zeros, ignores settings that it does not know, and may crash on
numbers out of range. Therefore a network is first tried in a separate process, and OpenCV is given Darknet's defaults
where its own differ.
"""

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.files import GOOD, read_bytes, read_text, run_isolated
from pipeline.tracks.find import KINDS, VICTIM
from pipeline.victims.detection.boxes import Boxes
from pipeline.victims.detection.input_image import Letterbox
from pipeline.victims.detection.weights import check_hash, header_size

PERSON = {1: (0, "people"), 20: (14, "Pascal VOC"), 80: (0, "COCO")}
"""For networks without class names, by number of classes: index of ``person``, and the source of the classes."""
KIND_OF = {kind: kind for kind in KINDS} | dict.fromkeys(("person", "doll"), VICTIM)
"""Kind of each known class by name, with underscores for spaces; other classes are ignored."""
WHOLE = re.compile(
    "width|height|channels|filters|size|stride|pad|padding|groups|group_id|batch_normalize|classes|num"
)
PLACES = re.compile("mask|layers|from")
DECIMAL = re.compile("anchors|scale_x_y")
"""Settings of one whole number (WHOLE); of whole numbers (PLACES) or decimals (DECIMAL), separated by commas."""
DEFAULTS = {
    "convolutional": {"filters": "1", "size": "1", "activation": "logistic"},
    "maxpool": {"stride": "1"},
    "upsample": {"stride": "2"},
    "reorg": {"stride": "1"},
}
"""Darknet's defaults of settings for which OpenCV has others."""
IGNORED = {
    "convolutional": dict.fromkeys(("antialiasing", "binary", "xnor", "deform", "assisted_excitation"), "0")
    | {"dilation": "1"},
    "maxpool": {"maxpool_depth": "0", "antialiasing": "0"},
    "upsample": {"scale": "1"},
    "shortcut": {"weights_type": "none"},
    "scale_channels": {"scale_wh": "0"},
    "region": {"coords": "4"},
}
"""Settings that OpenCV ignores, each with the only value for which the layer is still correct."""
HEADS = {"yolo": {"thresh": "0.0001", "nms_threshold": "0"}, "region": {"thresh": "0.0001"}}
"""Sections that decode boxes, with settings that make OpenCV return nearly all of them."""
SECONDS, MEMORY = 60, 3_000_000_000
"""Limits for reading a network: processor time, s, and memory, bytes; MEMORY also limits its layers' outputs."""
CRASHED = f"OpenCV crashed on this network, or needed more than {SECONDS} s or {MEMORY / 1e9:g} GB to read it"


class DarknetNetwork:
    """A Darknet network with [yolo] or [region] layers.

    Attributes:
        kinds: indices of its classes, by kind of object.
    """

    def __init__(self, sections: "Sequence[Section]", weights: bytes, kinds: dict[str, list[int]]) -> None:
        """Build it from the sections of a ``.cfg`` and the content of its weights; cv2.error if OpenCV cannot."""
        self.kinds, net = kinds, sections[0].settings
        self._size = int(net["width"]), int(net["height"])
        text = "".join(section.text for section in sections).encode()
        self._net = cv2.dnn.readNetFromDarknet(*(np.frombuffer(content, np.uint8) for content in (text, weights)))
        self._layers = {name: self._net.getLayer(self._net.getLayerId(name)) for name in self._net.getLayerNames()}
        self._heads = [name for name, layer in self._layers.items() if layer.type == "Region"]

    @classmethod
    def load(cls, cfg: Path, weights: Path) -> Self:
        """Read a ``.cfg``, its weights and, if it exists, the ``.names`` file next to the ``.cfg``.

        Raises:
            InputError: a file is missing or damaged, the files do not belong together, OpenCV cannot run the
                network, or none of its classes is known.
        """
        sections, beside = read_sections(cfg), cfg.with_suffix(".names")
        kinds = _kinds(cfg, sections, read_text(beside).split("\n") if beside.exists() else ())
        check_hash(weights)
        content = read_bytes(weights)
        size = len(content) - header_size(content, weights)
        said = run_isolated(cls._tried, sections, content, size, seconds=SECONDS, memory=MEMORY)
        if said != GOOD:
            raise InputError(f"{cfg}, {weights}: {said or CRASHED}")
        try:
            network = cls(sections, content, kinds)
            rows = network._rows(np.full((*network._size[::-1], 3), 128, np.uint8))
        except cv2.error as error:
            raise InputError(f"{cfg}: OpenCV cannot run this network: {' '.join(error.err.split())}") from error
        if not np.isfinite(rows).all():
            raise InputError(f"{weights}: the network's outputs with these weights are not finite; use other weights")
        return network

    @classmethod
    def _tried(cls, sections: "Sequence[Section]", weights: bytes, size: int) -> str:
        """What is wrong with a network, or GOOD; ``size``: bytes of the weights without their header."""
        try:
            network = cls(sections, weights, {})
            _, _, shapes = network._net.getLayersShapes([1, 3, *network._size[::-1]])
        except cv2.error as error:
            return f"OpenCV cannot run this network: {' '.join(error.err.split())}"
        if size != (needed := network._weights_size()):
            extent = "short" if size < needed else "long"
            return (
                f"the weights are too {extent} for the network: {size} bytes after the header, but it needs {needed}"
            )
        outputs = sum(4 * prod(map(int, shape)) for layer in shapes for shape in layer)
        if outputs <= MEMORY:
            return GOOD
        return (
            f"the network is too large: its layers take {outputs / 1e9:.2g} GB, more than {MEMORY / 1e9:g} GB; "
            "reduce width and height in the .cfg"
        )

    def find(self, image: Rgb, least: float) -> Boxes:
        """Boxes with a confidence of at least ``least``, pixels, several per object, and (N, classes) confidences."""
        letterbox, canvas = Letterbox.fit(image, *self._size)
        rows = self._rows(canvas)
        rows = rows[rows[:, 5:].max(axis=1, initial=0) >= least]
        middle, half = rows[:, :2] * self._size, rows[:, 2:4] * self._size / 2
        return letterbox.to_image(np.concatenate([middle - half, middle + half], axis=1)), rows[:, 5:]

    def _rows(self, canvas: Rgb) -> NDArray[np.float32]:
        """(N, 5 + classes) middle and size of boxes, as shares of the canvas, then objectness and confidences."""
        self._net.setInput(cv2.dnn.blobFromImage(canvas, 1 / 255))
        return np.concatenate([head.reshape(-1, head.shape[-1]) for head in self._net.forward(self._heads)])

    def _weights_size(self) -> int:
        """Size of the weights of all layers, bytes."""
        kinds = "Convolution", "BatchNorm", "InnerProduct"
        return sum(b.nbytes for layer in self._layers.values() if layer.type in kinds for b in layer.blobs)


@dataclass(frozen=True)
class Section:
    """A section of a ``.cfg``.

    Attributes:
        kind: the word in its brackets.
        where: file and line of its header.
        settings: its settings, by key.
    """

    kind: str
    where: str
    settings: dict[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The section as it is passed to OpenCV."""
        settings = DEFAULTS.get(self.kind, {}) | self.settings | HEADS.get(self.kind, {})
        if self.kind == "maxpool":
            settings = {"size": settings["stride"]} | settings
        return "\n".join([f"[{self.kind}]", *(f"{key}={value}" for key, value in settings.items())]) + "\n"

    def check(self) -> None:
        """Raise InputError for a setting that OpenCV would misread or ignore."""
        stride = self.settings.get("stride", "1")
        only = IGNORED.get(self.kind, {}) | {"stride_x": stride, "stride_y": stride}
        for key, value in self.settings.items():
            if WHOLE.fullmatch(key) and not re.fullmatch(r"\d{1,9}", value):
                raise self.error(f"{key}={value:.80}: must be a non-negative whole number of at most 9 digits")
            number = r"-?\d{1,9}" if PLACES.fullmatch(key) else r"\d*\.?\d+" if DECIMAL.fullmatch(key) else ""
            wanted = "whole numbers of at most 9 digits" if PLACES.fullmatch(key) else "non-negative decimal numbers"
            if number and not re.fullmatch(f"{number}( *, *{number})*,?", value):
                raise self.error(f"{key}={value:.80}: must be {wanted}, separated by commas")
            if value != only.get(key, value):
                raise self.error(f"{key}={value:.80}: must be {only[key]}, the only value supported here")
        if self.kind == "yolo":
            count = self.settings.get("anchors", "").strip(", ").count(",") // 2 + 1
            limits = (
                "0, as there is only one anchor"
                if count == 1
                else f"from 0 to {count - 1}, as there are {count} anchors"
            )
            if any(not 0 <= int(word) < count for word in self.settings.get("mask", "0").strip(", ").split(",")):
                raise self.error(f"mask={self.settings['mask']:.80}: must be {limits}")

    def error(self, message: str) -> InputError:
        """An error that names this section."""
        return InputError(f"{self.where}: [{self.kind}] {message}")


def read_sections(path: Path) -> list[Section]:
    """The sections of a ``.cfg``; the first is taken for [net].

    Raises:
        InputError: it cannot be read, is not a ``.cfg``, or has a setting that OpenCV would misread or ignore.
    """
    sections: list[Section] = []
    for number, raw in enumerate(read_text(path).splitlines(), 1):
        line = re.split("[#;]", raw)[0].strip()
        key, equals, value = line.partition("=")
        if line.startswith("[") and line.endswith("]"):
            sections.append(Section(line[1:-1].strip() if sections else "net", f"{path}:{number}"))
        elif equals and sections:
            sections[-1].settings[key.strip()] = value.strip()
        elif equals:
            raise InputError(f"{path}:{number}: {line!r:.40} must come after a section header such as [net]")
        elif line:
            raise InputError(f"{path}:{number}: {line!r:.40} must be [section] or key=value")
    if not sections or not {"width", "height"} <= sections[0].settings.keys():
        raise InputError(f"{path}: a Darknet .cfg must begin with a section [net] that sets width and height")
    for section in sections:
        section.check()
    return sections


def _kinds(cfg: Path, sections: Sequence[Section], names: Sequence[str]) -> dict[str, list[int]]:
    """Indices of the network's classes, by kind of object."""
    counts = {section.settings.get("classes", "20") for section in sections if section.kind in HEADS}
    if not counts:
        raise InputError(f"{cfg}: not a YOLO network: it has no [yolo] or [region] section")
    if len(counts) > 1:
        raise InputError(
            f"{cfg}: classes must be the same in all [yolo] and [region] sections, not {' and '.join(sorted(counts))}"
        )
    if (channels := sections[0].settings.get("channels", "3")) != "3":
        raise InputError(f"{cfg}: [net] channels={channels}: must be 3, because images are in colour")
    count, words = int(counts.pop()), ["_".join(word.split()).casefold() for word in names if word.strip()]
    if not words and count in PERSON:
        number, whose = PERSON[count]
        if count > 1:
            print(f"{cfg}: no .names file next to it; assuming the {count} classes of {whose}", file=sys.stderr)
        return {VICTIM: [number]}
    if words and len(words) != count:
        raise InputError(f"{cfg}: the network has {count} classes, but its .names file has {len(words)} names")
    kinds = [KIND_OF.get(word) for word in words]
    if not any(kinds):
        raise InputError(
            f"{cfg}: none of the network's {count} classes is known; "
            f"its .names file must contain at least one of {', '.join(KIND_OF)}"
        )
    return {kind: [i for i, other in enumerate(kinds) if other == kind] for kind in KINDS if kind in kinds}
