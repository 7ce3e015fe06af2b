"""The two networks of the shipped detector: YOLOv3-small, trained on arenas, and YOLOv3-tiny, trained on COCO.

Both follow Redmon and Farhadi, arXiv:1804.02767: the first is YOLOv3 with a quarter of Darknet-53's channels and one
residual block per stage; the second is as published, but with only the classes person and teddy bear.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

BATCH_NORM_EPSILON = 1e-6  # as in Darknet's batchnorm_layer.c on a CPU, and in OpenCV's reader
LEAKY_SLOPE = 0.1  # as in Darknet's activations.h
OBJECTNESS = 4
"""Index among an anchor's numbers in a cell: after x, y, width and height, before the only class."""
NUMBERS = OBJECTNESS + 2  # Count of an anchor's numbers in a cell
STRIDE = 32  # Pixels of the input per cell of the coarsest grid; the input's sides are multiples of it
Anchors = tuple[tuple[float, float], ...]
"""Widths and heights in the input, pixels."""


@dataclass(frozen=True)
class Grid:
    """The grid on which a head looks for people.

    Attributes:
        anchors: all anchors of the network, from small to large.
        mask: indices of this head's anchors.
    """

    anchors: Anchors
    mask: tuple[int, ...]


class Convolution(nn.Module):
    """Convolution, batch normalization and leaky ReLU; before a grid, only a convolution with a bias."""

    def __init__(self, channels: int, filters: int, size: int, stride: int = 1, is_last: bool = False) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels, filters, size, stride, size // 2, bias=is_last)
        self.norm = None if is_last else nn.BatchNorm2d(filters, BATCH_NORM_EPSILON)

    def forward(self, x: Tensor) -> Tensor:
        """(N, C, H, W) in and out."""
        x = self.conv(x)
        return x if self.norm is None else functional.leaky_relu(self.norm(x), LEAKY_SLOPE, inplace=True)


class Yolo(nn.Module):
    """A network that looks for people on several grids.

    Attributes:
        grids: its grids, the coarsest first.
    """

    grids: tuple[Grid, ...]

    def heads(self, images: Tensor) -> Iterator[Tensor]:
        """(N, anchors · NUMBERS, H, W) outputs for each grid, the coarsest first, each computed on demand.

        ``images`` are (N, 3, H, W), 0 to 1.
        """
        raise NotImplementedError

    def forward(self, images: Tensor) -> list[Tensor]:
        """The outputs of all heads."""
        return list(self.heads(images))

    @property
    def convolutions(self) -> list[Convolution]:
        """The convolutions, in the order of Darknet's layers."""
        return [module for module in self.modules() if isinstance(module, Convolution)]


class YoloSmall(Yolo):
    """YOLOv3-small, with grids of 32, 16 and 8 pixels per cell and three anchors on each.

    Attributes:
        ANCHORS: anchors of the shipped network, fitted to the people in its training images.
    """

    ANCHORS: Anchors = (
        *((11.2, 16.8), (22.4, 20), (27.2, 58.4), (62.8, 33.6), (58.4, 84.8), (137.2, 64)),
        *((92.8, 126.4), (160, 171.2), (255.2, 268)),
    )

    def __init__(self, anchors: Anchors = ANCHORS) -> None:
        super().__init__()
        self.grids = tuple(Grid(anchors, mask) for mask in ((6, 7, 8), (3, 4, 5), (0, 1, 2)))
        self.stem = nn.Sequential(Convolution(3, 16, 3, 2), Convolution(16, 32, 3, 2))
        self.stages = nn.ModuleList(_Stage(channels) for channels in (64, 128, 256))
        self.scales = nn.ModuleList([_Scale(256, 128, None), _Scale(128, 64, 128), _Scale(64, 32, 64)])

    def heads(self, images: Tensor) -> Iterator[Tensor]:
        """As :meth:`Yolo.heads`."""
        x, features = self.stem(images), list[Tensor]()
        for stage in self.stages:
            x = stage(x)
            features.append(x)
        coarser = None
        for scale, feature in zip(self.scales, reversed(features), strict=True):
            coarser = scale(feature, coarser)
            yield cast(_Scale, scale).head(coarser)


class _Stage(nn.Module):
    """Halves the resolution and doubles the channels, then applies a residual block."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.down = Convolution(channels // 2, channels, 3, 2)
        self.block = nn.Sequential(Convolution(channels, channels // 2, 1), Convolution(channels // 2, channels, 3))

    def forward(self, x: Tensor) -> Tensor:
        """(N, C / 2, H, W) in, (N, C, H / 2, W / 2) out."""
        x = self.down(x)
        return x + self.block(x)


class _Scale(nn.Module):
    """Combines the features of one scale with the output of the coarser scale, for its head."""

    def __init__(self, channels: int, filters: int, coarser: int | None) -> None:
        super().__init__()
        self.lateral = Convolution(coarser, filters, 1) if coarser else None
        self.narrow = Convolution(channels + (filters if coarser else 0), filters, 1)
        self.head = nn.Sequential(
            Convolution(filters, 2 * filters, 3), Convolution(2 * filters, 3 * NUMBERS, 1, is_last=True)
        )

    def forward(self, feature: Tensor, coarser: Tensor | None) -> Tensor:
        """(N, filters, H, W) input of the head, from (N, C, H, W) and the coarser scale's (N, C, H / 2, W / 2)."""
        if self.lateral is not None:
            feature = torch.cat([_upsampled(self.lateral(coarser)), feature], dim=1)
        x: Tensor = self.narrow(feature)
        return x


class YoloTiny(Yolo):
    """YOLOv3-tiny, with grids of 32 and 16 pixels per cell; the anchors come twice, for people and teddy bears."""

    ANCHORS: Anchors = ((10, 14), (23, 27), (37, 58), (81, 82), (135, 169), (344, 319))

    def __init__(self) -> None:
        super().__init__()
        self.grids = tuple(Grid(self.ANCHORS, 2 * mask) for mask in ((3, 4, 5), (0, 1, 2)))
        widths = (3, 16, 32, 64, 128, 256, 512, 1024)
        self.trunk = nn.ModuleList(Convolution(n, m, 3) for n, m in itertools.pairwise(widths))
        self.narrow = Convolution(1024, 256, 1)
        self.coarse = nn.Sequential(Convolution(256, 512, 3), Convolution(512, 6 * NUMBERS, 1, is_last=True))
        self.lateral = Convolution(256, 128, 1)
        self.fine = nn.Sequential(Convolution(128 + 256, 256, 3), Convolution(256, 6 * NUMBERS, 1, is_last=True))

    def heads(self, images: Tensor) -> Iterator[Tensor]:
        """As :meth:`Yolo.heads`."""
        x = images
        for convolution in self.trunk[:5]:
            feature = convolution(x)
            x = functional.max_pool2d(feature, 2)
        # The last pooling keeps the size; where its window crosses the edge, only the pixels inside count.
        x = functional.pad(self.trunk[5](x), (0, 1, 0, 1), value=float("-inf"))
        x = self.narrow(self.trunk[6](functional.max_pool2d(x, 2, stride=1)))
        yield self.coarse(x)
        yield self.fine(torch.cat([_upsampled(self.lateral(x)), feature], dim=1))


def _upsampled(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2, mode="nearest")
