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
WIDEST = 64  # Greatest size, stride, padding or dilation of a window
ACTIVATIONS = "linear", "leaky", "relu", "relu6", "logistic", "swish", "mish"


@dataclass(frozen=True)
class Convolutional:
    """A convolution; ``padding`` is on each side, in pixels of the input; each group has its own channels."""

    filters: int
    size: int
    stride: int
    padding: int
    batch_normalize: bool
    activation: str
    groups: int = 1
    dilation: int = 1


@dataclass(frozen=True)
class Maxpool:
    """Max pooling; half of ``padding`` is on each side, the odd pixel at the right and the bottom."""

    size: int
    stride: int
    padding: int


@dataclass(frozen=True)
class Avgpool:
    """The mean of each channel over the whole image."""


@dataclass(frozen=True)
class Dropout:
    """Nothing, outside training."""


@dataclass(frozen=True)
class Upsample:
    """Upsampling: every pixel is repeated ``stride`` times along both axes."""

    stride: int


@dataclass(frozen=True)
class RouteLayer:
    """The outputs of the layers with these numbers, of each one of ``groups``, joined along the channels."""

    layers: tuple[int, ...]
    groups: int = 1
    group: int = 0


@dataclass(frozen=True)
class Shortcut:
    """The sum of the outputs of the layer before and of the layer with this number."""

    layer: int
    activation: str = "linear"


@dataclass(frozen=True)
class Scale:
    """The product of the outputs of the layer with this number and of the layer before.

    The layer before has a number for each pixel ([sam]) or for each channel ([scale_channels]).
    """

    layer: int
    each_pixel: bool
    activation: str = "linear"


@dataclass(frozen=True)
class YoloHead:
    """Boxes at one scale, for the ``anchors`` (width, height in pixels of the input) with the numbers in ``mask``.

    ``scale_x_y`` stretches the range of a box's middle around that of its cell; ``new_coords`` means that the layer
    before has applied the logistic function, and that sizes are squares instead of exponentials. ``witnesses`` are
    numbers of earlier [yolo] layers: a box counts only where one of these sees something too. Darknet ignores them.
    """

    anchors: tuple[tuple[float, float], ...]
    mask: tuple[int, ...]
    classes: int
    scale_x_y: float = 1.0
    new_coords: bool = False
    witnesses: tuple[int, ...] = ()

    @property
    def channels(self) -> int:
        """Numbers in each cell: x, y, width, height, objectness and the classes of every anchor."""
        return len(self.mask) * (OBJECTNESS + 1 + self.classes)


Layer = Convolutional | Maxpool | Avgpool | Dropout | Upsample | RouteLayer | Shortcut | Scale | YoloHead


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
            raise InputError(f"{name}: {what}: not a YOLO network")
        witnesses = {place for layer in layers if isinstance(layer, YoloHead) for place in layer.witnesses}
        if others := sorted(place for place in witnesses if not isinstance(layers[place], YoloHead)):
            raise InputError(f"{name}: witnesses: layer {others[0]} is no [yolo]")
        return cls(width, height, channels, layers, name)

    @property
    def heads(self) -> list[YoloHead]:
        """The [yolo] layers, one per scale, in order."""
        return [layer for layer in self.layers if isinstance(layer, YoloHead)]

    @property
    def places(self) -> list[int]:
        """Numbers of the [yolo] layers, in order."""
        return [index for index, layer in enumerate(self.layers) if isinstance(layer, YoloHead)]

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
            raise self.error(f"unknown section; known are {known}")
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

    def source(self) -> int:
        """Index of the one layer that ``from`` refers to."""
        sources = self.sources("from")
        if len(sources) != 1:
            raise self.error(f"from: one layer, not {len(sources)}")
        return sources[0]

    def activation(self, default: str | None = "linear") -> str:
        """Name of the activation function."""
        return self.word("activation", ACTIVATIONS, default)

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
        """Raise InputError for other values of these settings: they would make another layer."""
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
    stride = section.whole("stride", 1, most=WIDEST)
    section.refuse_others(antialiasing="0", flipped="0", binary="0", xnor="0", deform="0", assisted_excitation="0")
    section.refuse_others(stride_x=str(stride), stride_y=str(stride))
    size, dilation = (section.whole(key, default, most=WIDEST) for key, default in (("size", None), ("dilation", 1)))
    padding = size // 2 if section.flag("pad") else section.whole("padding", 0, least=0, most=WIDEST)
    filters, groups = section.whole("filters"), section.whole("groups", 1)
    if filters % groups:
        raise section.error(f"groups={groups}: do not divide its {filters} filters")
    normalize, activation = section.flag("batch_normalize"), section.activation(None)
    # Darknet's im2col dilates the padding too.
    return Convolutional(filters, size, stride, padding * dilation, normalize, activation, groups, dilation)


def _maxpool(section: _Section) -> Maxpool:
    size, stride = section.whole("size", most=WIDEST), section.whole("stride", 1, most=WIDEST)
    section.refuse_others(maxpool_depth="0", antialiasing="0", stride_x=str(stride), stride_y=str(stride))
    return Maxpool(size, stride, section.whole("padding", size - 1, least=0, most=WIDEST))


def _upsample(section: _Section) -> Upsample:
    section.refuse_others(scale="1")
    return Upsample(section.whole("stride", 2, most=WIDEST))


def _route(section: _Section) -> RouteLayer:
    groups = section.whole("groups", 1)
    group = section.whole("group_id", 0, least=0, most=groups - 1)
    return RouteLayer(section.sources("layers"), groups, group)


def _shortcut(section: _Section) -> Shortcut:
    section.refuse_others(weights_type="none")
    return Shortcut(section.source(), section.activation())


def _scale_channels(section: _Section) -> Scale:
    section.refuse_others(scale_wh="0")
    return Scale(section.source(), False, section.activation())


def _sam(section: _Section) -> Scale:
    return Scale(section.source(), True, section.activation())


def _yolo(section: _Section) -> YoloHead:
    numbers = section.numbers("anchors", float)
    anchors = tuple(zip(numbers[::2], numbers[1::2], strict=False))
    if len(numbers) != 2 * section.whole("num") or not all(0 < number < inf for number in numbers):
        raise section.error(f"anchors: {section.whole('num')} pairs of positive numbers as num has it")
    mask = tuple(section.numbers("mask", int))
    if len(set(mask)) != len(mask) or not all(0 <= number < len(anchors) for number in mask):
        raise section.error(f"mask: numbers of anchors, 0 to {len(anchors) - 1}")
    scale = section.numbers("scale_x_y", float, "1")
    if len(scale) != 1 or not 0 < scale[0] < inf:
        raise section.error(f"scale_x_y={section.settings['scale_x_y']:.80}: one positive number")
    witnesses = section.sources("witnesses") if "witnesses" in section.settings else ()
    return YoloHead(anchors, mask, section.whole("classes"), scale[0], section.flag("new_coords"), witnesses)


_READERS: dict[str, Callable[[_Section], Layer]] = {
    "convolutional": _convolutional,
    "maxpool": _maxpool,
    "avgpool": lambda _: Avgpool(),
    "dropout": lambda _: Dropout(),
    "upsample": _upsample,
    "route": _route,
    "shortcut": _shortcut,
    "scale_channels": _scale_channels,
    "sam": _sam,
    "yolo": _yolo,
}
