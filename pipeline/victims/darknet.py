"""Darknet networks from any source, which OpenCV reads, runs and decodes.

OpenCV reads missing weights as zeros, ignores settings that it does not know, and may crash on numbers out of range.
Therefore the settings are checked first, and OpenCV is given Darknet's defaults where OpenCV's own defaults differ.
"""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np

from pipeline.errors import InputError
from pipeline.files import check_hash, read_bytes, read_text
from pipeline.victims.boxes import ScoredBoxes
from pipeline.victims.opencv_network import OpenCvNetwork, checked_network, kinds_of

WHOLE_NUMBER_KEYS = re.compile(
    "width|height|channels|filters|size|stride|pad|padding|groups|group_id|batch_normalize|classes|num"
)
WHOLE_NUMBER_LIST_KEYS = re.compile("mask|layers|from")
DECIMAL_LIST_KEYS = re.compile("anchors|scale_x_y")
"""Names of settings that hold one whole number, several whole numbers, or several decimal numbers."""
DEFAULTS = {
    "convolutional": {"filters": "1", "size": "1", "activation": "logistic"},
    "maxpool": {"stride": "1"},
    "upsample": {"stride": "2"},
    "reorg": {"stride": "1"},
}
"""Darknet's defaults for settings for which OpenCV has other defaults."""
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


class DarknetNetwork(OpenCvNetwork):
    """A Darknet network with [yolo] or [region] layers."""

    def __init__(self, sections: "Sequence[Section]", weights: bytes, header: int) -> None:
        """Create a network from the sections of a ``.cfg`` and the content of its weights file.

        Args:
            sections: sections of the ``.cfg``.
            weights: content of the weights file.
            header: size of the header of the weights file, bytes.

        Raises:
            cv2.error: OpenCV cannot read the network.
        """
        net = sections[0].settings
        self.size = int(net["width"]), int(net["height"])
        text = "".join(section.text for section in sections).encode()
        self.net = cv2.dnn.readNetFromDarknet(*(np.frombuffer(content, np.uint8) for content in (text, weights)))
        self._layers = {name: self.net.getLayer(self.net.getLayerId(name)) for name in self.net.getLayerNames()}
        self.outputs = [name for name, layer in self._layers.items() if layer.type == "Region"]
        self._bytes = len(weights) - header
        self.kinds = {}

    @classmethod
    def load(cls, cfg: Path, weights: Path, names: Sequence[str], where: str) -> Self:
        """Read a ``.cfg`` and its weights; ``names``: names of the classes, which come from the file ``where``.

        Raises:
            InputError: a file is missing or damaged, the files do not belong together, OpenCV cannot run the
                network, or none of the network's classes is known.
        """
        sections = read_sections(cfg)
        kinds = kinds_of(cfg, _class_count(cfg, sections), names, where)
        check_hash(weights)
        content = read_bytes(weights)
        network = checked_network(f"{cfg}, {weights}", partial(cls, sections, content, header_size(content, weights)))
        network.kinds = kinds
        return network

    def check(self) -> None:
        """See :meth:`OpenCvNetwork.check`: the weights must have the length that the layers need."""
        kinds = "Convolution", "BatchNorm", "InnerProduct"
        needed = sum(b.nbytes for layer in self._layers.values() if layer.type in kinds for b in layer.blobs)
        if self._bytes != needed:
            extent = "short" if self._bytes < needed else "long"
            raise InputError(
                f"the weights are too {extent} for the network: {self._bytes} bytes after the header, "
                f"but it needs {needed}"
            )

    def decode(self, outputs: Sequence[Any]) -> ScoredBoxes:
        """See :meth:`OpenCvNetwork.decode`: rows hold fractions of the input, objectness and confidences."""
        rows = np.concatenate([head.reshape(-1, head.shape[-1]) for head in outputs])
        middle = rows[:, :2] * self.size
        half = rows[:, 2:4] * self.size / 2
        return np.concatenate([middle - half, middle + half], axis=1), rows[:, 5:]


@dataclass(frozen=True)
class Section:
    """A section of a ``.cfg``.

    Attributes:
        kind: the word in the brackets of the header.
        where: file and line of the header.
        settings: settings of the section, by key.
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
            if WHOLE_NUMBER_KEYS.fullmatch(key) and not re.fullmatch(r"\d{1,9}", value):
                raise self.error(f"{key}={value:.80}: must be a non-negative whole number of at most 9 digits")
            number = (
                r"-?\d{1,9}"
                if WHOLE_NUMBER_LIST_KEYS.fullmatch(key)
                else r"\d*\.?\d+"
                if DECIMAL_LIST_KEYS.fullmatch(key)
                else ""
            )
            wanted = (
                "whole numbers of at most 9 digits"
                if WHOLE_NUMBER_LIST_KEYS.fullmatch(key)
                else "non-negative decimal numbers"
            )
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
    """The sections of a ``.cfg``; the first section is read as [net], whatever its header.

    Raises:
        InputError: the file cannot be read, is not a ``.cfg``, or has a setting that OpenCV would misread or ignore.
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


def _class_count(cfg: Path, sections: Sequence[Section]) -> int:
    """The number of the network's classes; InputError if the network does not find boxes in colour images."""
    counts = {section.settings.get("classes", "20") for section in sections if section.kind in HEADS}
    if not counts:
        raise InputError(f"{cfg}: not a YOLO network: it has no [yolo] or [region] section")
    if len(counts) > 1:
        raise InputError(
            f"{cfg}: classes must be the same in all [yolo] and [region] sections, not {' and '.join(sorted(counts))}"
        )
    if (channels := sections[0].settings.get("channels", "3")) != "3":
        raise InputError(f"{cfg}: [net] channels={channels}: must be 3, because images are in colour")
    return int(counts.pop())


def header_size(content: bytes, path: Path) -> int:
    """Size of the header of a weights file, bytes; InputError if the file has no header.

    The header consists of three int32 (major, minor, revision) and the number of images seen, int64 (int32 before
    version 0.2).
    """
    try:
        major, minor, _ = struct.unpack_from("<iii", content)
    except struct.error as error:
        raise InputError(
            f"{path}: not a Darknet weights file: {len(content)} bytes are too few for the header; use another file"
        ) from error
    if not all(0 <= part < 1000 for part in (major, minor)):  # as in Darknet's parser.c
        raise InputError(
            f"{path}: not a Darknet weights file: its version is {major}.{minor}; both numbers must be from 0 to 999"
        )
    return 20 if 10 * major + minor >= 2 else 16
