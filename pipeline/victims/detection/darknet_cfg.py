"""Darknet's descriptions of networks: reads the text of a ``.cfg`` file into typed layers.

The text consists of sections: ``[kind]``, and under it lines of ``key=value``.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import TypeVar

from pipeline.errors import InputError
from pipeline.files import read_text

N = TypeVar("N", int, float)
OBJECTNESS = 4
"""Place among the numbers that a [yolo] reads for an anchor of a cell: after x, y, width, height, before classes."""
WIDEST = 64  # Greatest size, stride or padding of a window


@dataclass(frozen=True)
class Convolutional:
    """A convolution; ``padding`` is on each side."""

    filters: int
    size: int
    stride: int
    padding: int
    batch_normalize: bool
    activation: str


@dataclass(frozen=True)
class Maxpool:
    """Max pooling; half of ``padding`` is on each side, the odd pixel at the right and the bottom."""

    size: int
    stride: int
    padding: int


@dataclass(frozen=True)
class Upsample:
    """Upsampling: every pixel is repeated ``stride`` times along both axes."""

    stride: int


@dataclass(frozen=True)
class RouteLayer:
    """The outputs of the layers with these numbers, concatenated along the channels."""

    layers: tuple[int, ...]


@dataclass(frozen=True)
class Shortcut:
    """The sum of the outputs of the layer before and of the layer with this number."""

    layer: int


@dataclass(frozen=True)
class YoloHead:
    """Boxes at one scale, for the ``anchors`` (width, height in pixels of the input) with the numbers in ``mask``."""

    anchors: tuple[tuple[float, float], ...]
    mask: tuple[int, ...]
    classes: int

    @property
    def channels(self) -> int:
        """Numbers in each cell: x, y, width, height, objectness and the classes of every anchor."""
        return len(self.mask) * (OBJECTNESS + 1 + self.classes)


Layer = Convolutional | Maxpool | Upsample | RouteLayer | Shortcut | YoloHead


@dataclass(frozen=True)
class DarknetCfg:
    """A network.

    Attributes:
        width, height: of its input, pixels.
        channels: of its input.
        layers: in order; layers refer to one another by their index in this tuple.
        name: its name in error messages.
    """

    width: int
    height: int
    channels: int
    layers: tuple[Layer, ...]
    name: str = "cfg"

    @classmethod
    def read(cls, path: Path) -> "DarknetCfg":
        """Read a file. InputError if it cannot be read, and as :meth:`parse`."""
        return cls.parse(read_text(path), str(path))

    @classmethod
    def parse(cls, text: str, name: str = "cfg") -> "DarknetCfg":
        """Read a text; InputError, with the line, if a section or setting is unknown, missing or impossible."""
        sections = _read_sections(text, name)
        if not sections or sections[0].kind not in ("net", "network"):
            raise InputError(f"{name}: a Darknet .cfg begins with [net]")
        width, height, channels = (sections[0].whole(key) for key in ("width", "height", "channels"))
        layers = tuple(section.layer() for section in sections[1:])
        classes = {layer.classes for layer in layers if isinstance(layer, YoloHead)}
        if len(classes) != 1:
            what = "several numbers of classes" if classes else "no [yolo] section"
            raise InputError(f"{name}: {what}: not a YOLOv3 network")
        return cls(width, height, channels, layers, name)

    @property
    def heads(self) -> list[YoloHead]:
        """The [yolo] layers, one per scale, in order."""
        return [layer for layer in self.layers if isinstance(layer, YoloHead)]

    @property
    def classes(self) -> int:
        """Number of classes."""
        return self.heads[0].classes


@dataclass(frozen=True)
class _Section:
    """One section.

    Attributes:
        kind: the word in its brackets.
        where: file and line, for errors.
        index: of its layer; −1 for [net].
        settings: by key.
    """

    kind: str
    where: str
    index: int
    settings: dict[str, str] = field(default_factory=dict)

    def error(self, message: str) -> InputError:
        """An error that names this section."""
        return InputError(f"{self.where}: [{self.kind}] {message}")

    def layer(self) -> Layer:
        """The layer that the section describes."""
        if self.kind not in _READERS:
            known = ", ".join(f"[{kind}]" for kind in _READERS)
            raise self.error(f"unknown section; YOLOv3 has {known}")
        return _READERS[self.kind](self)

    def sources(self, key: str) -> tuple[int, ...]:
        """Indices of the layers that a setting refers to; a negative number counts back from this layer."""
        numbers = self.numbers(key, int)
        indices = tuple(number + self.index if number < 0 else number for number in numbers)
        for number, index in zip(numbers, indices, strict=True):
            if not 0 <= index < self.index:
                raise self.error(f"layer {number}: there is no such layer before it")
        return indices

    def whole(self, key: str, default: int | None = None, least: int = 1, most: int = 65535) -> int:
        """A whole number from ``least`` to ``most``."""
        numbers = self.numbers(key, int, None if default is None else str(default))
        if len(numbers) != 1 or not least <= numbers[0] <= most:
            raise self.error(f"{key}={self.settings.get(key)!s:.80}: one number, at least {least} and at most {most}")
        return numbers[0]

    def numbers(self, key: str, kind: type[N], default: str | None = None) -> list[N]:
        """A setting of whole numbers or decimals, separated by commas."""
        text = self._text(key, default)
        try:
            return [kind(word) for word in text.replace(" ", "").split(",") if word]
        except ValueError:
            what = "a whole number" if kind is int else "a number"
            raise self.error(f"{key}={text:.80}: not {what}") from None

    def flag(self, key: str) -> bool:
        """Whether a setting is 1; it may be 0 or absent."""
        return self.word(key, ("0", "1"), "0") == "1"

    def word(self, key: str, known: Sequence[str], default: str | None = None) -> str:
        """A setting that must be one of the known words."""
        text = self._text(key, default)
        if text not in known:
            raise self.error(f"{key}={text:.80}: known are {', '.join(known)}")
        return text

    def refuse_others(self, **only: str) -> None:
        """Raise InputError for other values of these settings: they would make a layer that YOLOv3 does not have."""
        for key, value in only.items():
            self.word(key, (value,), value)

    def _text(self, key: str, default: str | None) -> str:
        text = self.settings.get(key, default)
        if text is None:
            raise self.error(f"{key} is missing")
        return text


def adapted(text: str, width: int, height: int, classes: int, anchors: Sequence[tuple[float, float]]) -> str:
    """The text with another input, ``width`` × ``height`` pixels, and other ``classes`` and ``anchors``, in pixels.

    The convolution before each [yolo] gets as many filters as that asks for; all other layers stay.
    """

    def with_filters(match: re.Match[str]) -> str:
        mask = tuple(map(int, match["mask"].split(",")))
        return f"{match['head']}{YoloHead(tuple(anchors), mask, classes).channels}{match['tail']}"

    listed = ", ".join(f"{w:g},{h:g}" for w, h in anchors)
    settings = {"width": width, "height": height, "classes": classes, "anchors": listed, "num": len(anchors)}
    for key, value in settings.items():
        text = re.sub(rf"^{key}=.*", f"{key}={value}", text, flags=re.MULTILINE)
    head = r"(?P<head>filters=)\d+(?P<tail>[^[]*\[yolo\][^[]*mask=(?P<mask>[\d,]+))"
    return re.sub(head, with_filters, text)


def _read_sections(text: str, name: str) -> list[_Section]:
    """All sections of a text; ``name`` is its name in error messages.

    Raises:
        InputError: a line that is neither a section's head nor a setting of one.
    """
    sections: list[_Section] = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.split("#")[0].strip()
        if not line or line.startswith(";"):
            continue
        where = f"{name}:{number}"
        key, equals, value = line.partition("=")
        if line.startswith("[") and line.endswith("]"):
            sections.append(_Section(line[1:-1].strip(), where, len(sections) - 1))
        elif equals and sections:
            sections[-1].settings[key.strip()] = value.strip()
        else:
            raise InputError(f"{where}: neither [section] nor key=value: {line[:40]}")
    return sections


def _convolutional(section: _Section) -> Convolutional:
    section.refuse_others(groups="1", dilation="1", antialiasing="0", flipped="0", binary="0", xnor="0")
    size = section.whole("size", most=WIDEST)
    padding = size // 2 if section.flag("pad") else section.whole("padding", 0, least=0, most=WIDEST)
    activation = section.word("activation", ("leaky", "linear"))
    stride, normalize = section.whole("stride", 1, most=WIDEST), section.flag("batch_normalize")
    return Convolutional(section.whole("filters"), size, stride, padding, normalize, activation)


def _maxpool(section: _Section) -> Maxpool:
    section.refuse_others(maxpool_depth="0", antialiasing="0")
    size, stride = section.whole("size", most=WIDEST), section.whole("stride", 1, most=WIDEST)
    return Maxpool(size, stride, section.whole("padding", size - 1, least=0, most=WIDEST))


def _upsample(section: _Section) -> Upsample:
    section.refuse_others(scale="1")
    return Upsample(section.whole("stride", 2, most=WIDEST))


def _route(section: _Section) -> RouteLayer:
    section.refuse_others(groups="1")
    return RouteLayer(section.sources("layers"))


def _shortcut(section: _Section) -> Shortcut:
    section.refuse_others(weights_type="none")
    section.word("activation", ("linear",))
    sources = section.sources("from")
    if len(sources) != 1:
        raise section.error(f"from: one layer, not {len(sources)}")
    return Shortcut(sources[0])


def _yolo(section: _Section) -> YoloHead:
    section.refuse_others(scale_x_y="1", new_coords="0")
    numbers = section.numbers("anchors", float)
    anchors = tuple(zip(numbers[::2], numbers[1::2], strict=False))
    if len(numbers) != 2 * section.whole("num") or not all(0 < number < inf for number in numbers):
        raise section.error(f"anchors: {section.whole('num')} pairs of positive numbers as num has it")
    mask = tuple(section.numbers("mask", int))
    if len(set(mask)) != len(mask) or not all(0 <= number < len(anchors) for number in mask):
        raise section.error(f"mask: numbers of anchors, 0 to {len(anchors) - 1}")
    return YoloHead(anchors, mask, section.whole("classes"))


_READERS: dict[str, Callable[[_Section], Layer]] = {
    "convolutional": _convolutional,
    "maxpool": _maxpool,
    "upsample": _upsample,
    "route": _route,
    "shortcut": _shortcut,
    "yolo": _yolo,
}
