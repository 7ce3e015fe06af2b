"""Networks of the YOLOv3 and YOLOv4 families in PyTorch, layer by layer as a Darknet ``.cfg`` describes them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import prod

import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.errors import InputError
from pipeline.victims.detection.darknet_cfg import (
    Avgpool,
    Convolutional,
    DarknetCfg,
    Layer,
    Maxpool,
    RouteLayer,
    Scale,
    Shortcut,
    Upsample,
    YoloHead,
)

BATCH_NORM_EPSILON = 1e-6  # as Darknet's batchnorm_layer.c on a processor, and OpenCV's reader
LEAKY_SLOPE = 0.1  # as Darknet's activations.h
ACTIVATE: dict[str, Callable[[Tensor], Tensor]] = {
    "linear": lambda x: x,
    "leaky": lambda x: functional.leaky_relu(x, LEAKY_SLOPE, inplace=True),
    "relu": functional.relu_,
    "relu6": lambda x: functional.relu6(x, inplace=True),
    "logistic": torch.sigmoid,
    "swish": functional.silu,
    "mish": functional.mish,
}
MOST_NUMBERS = 2**29
"""Most weights of a network, and most numbers that it computes for an image: 2 GB each; YOLOv3 has 62 million
weights, and computes 345 million numbers for an image of 1024 × 1024 pixels."""


class DarknetNetwork(nn.Module):
    """A network of the YOLOv3 family.

    Attributes:
        cfg: the description from which it was built.
        shapes: (channels, height, width) of each layer's output.
    """

    def __init__(self, cfg: DarknetCfg) -> None:
        """Build it with random weights.

        Raises:
            InputError: layers that do not fit together, or a network that needs too much memory.
        """
        super().__init__()
        self.cfg = cfg
        self.shapes = _shapes(cfg)
        _check_size(cfg, self.shapes)
        inputs = [(cfg.channels, cfg.height, cfg.width), *self.shapes]
        self.layers = nn.ModuleList(_module(layer, inputs[i]) for i, layer in enumerate(cfg.layers))
        self._kept = {i for layer in cfg.layers if isinstance(layer, RouteLayer) for i in layer.layers}
        self._kept |= {layer.layer for layer in cfg.layers if isinstance(layer, Shortcut | Scale)}

    def forward(self, images: Tensor) -> list[Tensor]:
        """(N, anchors · (5 + classes), H, W) input of each [yolo], from (N, C, H, W) images of 0 to 1."""
        kept: dict[int, Tensor] = {}
        heads: list[Tensor] = []
        x = images
        for index, (layer, module) in enumerate(zip(self.cfg.layers, self.layers, strict=True)):
            match layer:
                case RouteLayer():
                    sources = [kept[i].chunk(layer.groups, dim=1)[layer.group] for i in layer.layers]
                    x = torch.cat(sources, dim=1) if sources[1:] else sources[0]
                case Shortcut():
                    x = ACTIVATE[layer.activation](x + kept[layer.layer])
                case Scale():
                    x = ACTIVATE[layer.activation](x * kept[layer.layer])
                case YoloHead():
                    heads.append(x)
                case _:
                    x = module(x)
            if index in self._kept:
                kept[index] = x
        return heads

    @property
    def stride(self) -> int:
        """Pixels of the input, along one side, per cell of the coarsest scale."""
        heads = zip(self.cfg.layers, self.shapes, strict=True)
        return self.cfg.width // min(shape[2] for layer, shape in heads if isinstance(layer, YoloHead))

    def resized(self, width: int, height: int) -> "DarknetNetwork":
        """A network in evaluation mode with the same weights for an input of another size.

        Raises:
            InputError: layers that do not fit together at that size.
        """
        return self._with(replace(self.cfg, width=width, height=height))

    def witnesses(self) -> "DarknetNetwork | None":
        """A network in evaluation mode of the layers up to the last that is a witness; None if none is."""
        places = {place for head in self.cfg.heads for place in head.witnesses}
        return self._with(replace(self.cfg, layers=self.cfg.layers[: max(places) + 1])) if places else None

    def _with(self, cfg: DarknetCfg) -> "DarknetNetwork":
        network = DarknetNetwork(cfg).eval()
        network.load_state_dict(
            {name: value for name, value in self.state_dict().items() if name in network.state_dict()}
        )
        return network

    @property
    def convolutions(self) -> list["DarknetConvolution"]:
        """Convolutions in the order of the weights file."""
        return [module for module in self.layers if isinstance(module, DarknetConvolution)]


class DarknetConvolution(nn.Module):
    """Convolution, with batch normalization and activation if the layer has them."""

    def __init__(self, layer: Convolutional, channels: int) -> None:
        super().__init__()
        normalize = layer.batch_normalize
        window = layer.size, layer.stride, layer.padding, layer.dilation, layer.groups
        self.conv = nn.Conv2d(channels, layer.filters, *window, bias=not normalize)
        self.norm = nn.BatchNorm2d(layer.filters, BATCH_NORM_EPSILON) if normalize else None
        self.activation = layer.activation

    def forward(self, x: Tensor) -> Tensor:
        """(N, C, H, W) in and out."""
        x = self.conv(x)
        if self.norm is not None:
            x = self.norm(x)
        return ACTIVATE[self.activation](x)


class DarknetMaxpool(nn.Module):
    """Darknet's max pooling: of a window over the edge, only pixels inside the image count."""

    def __init__(self, layer: Maxpool, height: int, width: int) -> None:
        super().__init__()
        self.size, self.stride = layer.size, layer.stride
        left = layer.padding // 2
        reach = ((_pooled(layer, extent) - 1) * self.stride + self.size for extent in (width, height))
        right, bottom = (end - left - extent for end, extent in zip(reach, (width, height), strict=True))
        self.margins = (left, right, left, bottom)

    def forward(self, x: Tensor) -> Tensor:
        """(N, C, H, W) in and out."""
        if any(self.margins):
            x = functional.pad(x, self.margins, value=float("-inf"))
        return functional.max_pool2d(x, self.size, self.stride)


def _pooled(layer: Maxpool, extent: int) -> int:
    return (extent + layer.padding - layer.size) // layer.stride + 1


def _module(layer: Layer, shape: tuple[int, int, int]) -> nn.Module:
    match layer:
        case Convolutional():
            return DarknetConvolution(layer, shape[0])
        case Maxpool():
            return DarknetMaxpool(layer, *shape[1:])
        case Avgpool():
            return nn.AdaptiveAvgPool2d(1)
        case Upsample():
            return nn.Upsample(scale_factor=layer.stride, mode="nearest")
    return nn.Identity()  # dropout; and DarknetNetwork.forward computes what joins layers


def _shapes(cfg: DarknetCfg) -> list[tuple[int, int, int]]:
    shapes: list[tuple[int, int, int]] = []
    before = (cfg.channels, cfg.height, cfg.width)
    for index, layer in enumerate(cfg.layers):
        before = _shape(layer, before, shapes, f"{cfg.name}: layer {index} ({_kind(layer)})")
        if min(before) < 1:
            raise InputError(f"{cfg.name}: nothing is left after layer {index}: make the input larger")
        shapes.append(before)
    return shapes


def _kind(layer: Layer) -> str:
    return type(layer).__name__.removesuffix("Layer").removesuffix("Head").lower()


def _shape(
    layer: Layer, before: tuple[int, int, int], shapes: Sequence[tuple[int, int, int]], where: str
) -> tuple[int, int, int]:
    channels, height, width = before
    match layer:
        case Convolutional():
            if channels % layer.groups:
                raise InputError(f"{where}: groups={layer.groups} do not divide {channels} channels")
            window = layer.dilation * (layer.size - 1) + 1
            extents = ((e + 2 * layer.padding - window) // layer.stride + 1 for e in (height, width))
            return (layer.filters, *extents)  # type: ignore[return-value]
        case Avgpool():
            return channels, 1, 1
        case Maxpool():
            return channels, _pooled(layer, height), _pooled(layer, width)
        case Upsample():
            return channels, height * layer.stride, width * layer.stride
        case RouteLayer():
            sources = [shapes[i] for i in layer.layers]
            if len({shape[1:] for shape in sources}) != 1:
                raise InputError(f"{where}: layers of other sizes: {_sizes(sources)}")
            if any(shape[0] % layer.groups for shape in sources):
                raise InputError(f"{where}: groups={layer.groups} do not divide the channels of {_sizes(sources)}")
            return (sum(shape[0] // layer.groups for shape in sources), *sources[0][1:])
        case Shortcut() | Scale():
            source = shapes[layer.layer]
            is_each = isinstance(layer, Shortcut) or layer.each_pixel
            if before != (source if is_each else (source[0], 1, 1)):
                raise InputError(f"{where}: layers of other sizes: {_sizes([source, before])}")
            return source
        case YoloHead():
            if channels != layer.channels:
                raise InputError(f"{where}: needs filters={layer.channels} before it, not {channels}")
    return before


def _check_size(cfg: DarknetCfg, shapes: Sequence[tuple[int, int, int]]) -> None:
    """Raise InputError for a too large network before its memory is allocated."""
    inputs = [cfg.channels, *(channels for channels, _, _ in shapes)]
    convolutions = [
        (layer, n) for layer, n in zip(cfg.layers, inputs, strict=False) if isinstance(layer, Convolutional)
    ]
    weights = sum(layer.filters * n * layer.size**2 // layer.groups for layer, n in convolutions)
    outputs = cfg.channels * cfg.height * cfg.width + sum(map(prod, shapes))
    for count, what in ((weights, "weights"), (outputs, "numbers for an image")):
        if count > MOST_NUMBERS:
            raise InputError(
                f"{cfg.name}: too large: {count:.2g} {what}, at most {MOST_NUMBERS:.2g} are computed with"
            )


def _sizes(shapes: Sequence[tuple[int, int, int]]) -> str:
    return ", ".join("×".join(map(str, shape)) for shape in shapes)
