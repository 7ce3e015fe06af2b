"""The two networks of the shipped detector: YOLOv3-small, trained on arenas, and YOLOv3-tiny, trained on COCO.

Both follow Redmon and Farhadi, arXiv:1804.02767. The first is YOLOv3 with a quarter of Darknet-53's channels and one
residual block per stage. The second is as published, but with only the classes person and teddy bear.

Both run on the robot's CPU. Batch normalisation is folded into the convolution, which also applies the activation.
Kernels are stored in oneDNN's layout, and images have their channels last. torch.compile calls the same operators on
a CPU, but direct calls need no C++ compiler on the robot and save a minute of compiling.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import expit, logit
from torch import Tensor
from torch.nn import functional

from pipeline.arrays import Rgb
from pipeline.files import check_hash
from pipeline.semantic_map.networks.tensor_file import copy_tensors, read_tensors
from pipeline.victims.boxes import ScoredBoxes, joined
from pipeline.victims.input_image import Letterbox

BATCH_NORM_EPSILON = 1e-6  # as in Darknet's batchnorm_layer.c on a CPU, and in OpenCV's reader
LEAKY_SLOPE = 0.1  # as in Darknet's activations.h
OBJECTNESS = 4
"""Index of the objectness among an anchor's numbers in a cell: after x, y, width and height, before the class."""
MAX_EXPONENT = 20.0
"""Limit of the exponent that scales an anchor; no box in an image is so large, and the square still fits float32."""
Anchors = tuple[tuple[float, float], ...]
"""Widths and heights in the input, pixels."""


class Convolution:
    """Convolution, batch normalisation and leaky ReLU as one operator; before a grid, a convolution with a bias."""

    def __init__(self, tensors: Mapping[str, Tensor], stride: int) -> None:
        """Create the operator from a layer's float32 tensors: a kernel (filters, channels, size, size) and others."""
        kernel = tensors["conv.weight"]
        self._activation: tuple[str, list[float]] = ("none", [])
        bias = tensors.get("conv.bias")
        if bias is None:
            # Double precision is used, because a variance close to 0 gives factors that float32 rounds badly.
            variance = tensors["norm.running_var"].double()
            scale = tensors["norm.weight"].double() / (variance + BATCH_NORM_EPSILON).sqrt()
            bias = (tensors["norm.bias"].double() - scale * tensors["norm.running_mean"].double()).float()
            kernel = kernel * scale.float()[:, None, None, None]
            self._activation = ("leaky_relu", [LEAKY_SLOPE])
        padding = kernel.shape[-1] // 2
        self._bias = bias
        self._kernel = kernel.contiguous(memory_format=torch.channels_last)
        self._window = ([padding, padding], [stride, stride], [1, 1], 1)
        self._kernels: dict[torch.Size, Tensor] = {}  # By shape of the input

    def __call__(self, x: Tensor) -> Tensor:
        """Apply the layer to features (N, C, H, W)."""
        if x.shape not in self._kernels:  # oneDNN would convert the layout for another shape at every call
            reorder = torch.ops.mkldnn._reorder_convolution_weight
            self._kernels[x.shape] = reorder(self._kernel, *self._window, list(x.shape))
        fused = torch.ops.mkldnn._convolution_pointwise
        result: Tensor = fused(x, self._kernels[x.shape], self._bias, *self._window, *self._activation, "")
        return result


class Yolo(ABC):
    """A network that finds people in single images of any size.

    Attributes:
        LAYERS: channels, filters, kernel size and stride of each convolution, by the convolution's number in the
            shipped file. The numbers count the layers of both networks as Darknet does.
        GRIDS: the anchors of each grid, the coarsest first.
    """

    LAYERS: ClassVar[dict[int, tuple[int, int, int, int]]]
    GRIDS: ClassVar[tuple[Anchors, ...]]

    def __init__(self, tensors: Mapping[str, Tensor]) -> None:
        """Create a network from the float32 tensors of the shipped file, named ``layers.N.conv.weight`` and so on."""
        self.layers: dict[int, Convolution] = {}
        for number, (*_, stride) in self.LAYERS.items():
            start = f"layers.{number}."
            layer = {name.removeprefix(start): t for name, t in tensors.items() if name.startswith(start)}
            self.layers[number] = Convolution(layer, stride)

    @abstractmethod
    def heads(self, images: Tensor) -> Iterator[Tensor]:
        """(N, anchors · 6, H, W) outputs for each grid, each computed on demand.

        ``images`` are (N, 3, H, W), 0 to 1.
        """

    def boxes(
        self, image: Rgb, size: tuple[int, int], min_objectness: float, heads: int | None = None
    ) -> ScoredBoxes:
        """Boxes of people in an image, pixels, several per person, and their (N, 1) confidences.

        Args:
            image: the image, of any size.
            size: width and height of the input into which the image is fitted, pixels, multiples of 32.
            min_objectness: minimum objectness of a box.
            heads: number of heads to compute, the coarsest first; by default all.
        """
        letterbox, canvas = Letterbox.fit(image, *size)
        with torch.inference_mode():
            pixels = torch.from_numpy(np.ascontiguousarray(canvas[None])).permute(0, 3, 1, 2).float().div_(255)
            outputs = islice(self.heads(pixels), heads)
            answers = [output[0].numpy() for output in outputs]
        grids = zip(answers, self.GRIDS, strict=False)
        boxes, scores = joined(decode(answer, anchors, *size, min_objectness) for answer, anchors in grids)
        return letterbox.to_image(boxes), scores


class YoloSmall(Yolo):
    """YOLOv3-small, with grids of 32, 16 and 8 pixels per cell; the three anchors per grid fit the training data."""

    LAYERS: ClassVar = {
        26: (3, 16, 3, 2), 27: (16, 32, 3, 2),
        28: (32, 64, 3, 2), 29: (64, 32, 1, 1), 30: (32, 64, 3, 1),
        32: (64, 128, 3, 2), 33: (128, 64, 1, 1), 34: (64, 128, 3, 1),
        36: (128, 256, 3, 2), 37: (256, 128, 1, 1), 38: (128, 256, 3, 1),
        40: (256, 128, 1, 1), 41: (128, 256, 3, 1), 42: (256, 18, 1, 1),
        45: (128, 64, 1, 1), 48: (192, 64, 1, 1), 49: (64, 128, 3, 1), 50: (128, 18, 1, 1),
        53: (64, 32, 1, 1), 56: (96, 32, 1, 1), 57: (32, 64, 3, 1), 58: (64, 18, 1, 1),
    }  # fmt: skip
    GRIDS = (
        ((92.8, 126.4), (160, 171.2), (255.2, 268)),
        ((62.8, 33.6), (58.4, 84.8), (137.2, 64)),
        ((11.2, 16.8), (22.4, 20), (27.2, 58.4)),
    )

    def heads(self, images: Tensor) -> Iterator[Tensor]:
        """See :meth:`Yolo.heads`."""
        layers = self.layers
        x = layers[27](layers[26](images))
        features = []
        for down in (28, 32, 36):  # each stage halves the resolution, then applies a residual block
            x = layers[down](x)
            x = x + layers[down + 2](layers[down + 1](x))
            features.append(x)
        fine, middle, coarse = features
        x = layers[40](coarse)
        yield layers[42](layers[41](x))
        x = layers[48](torch.cat([_upsampled(layers[45](x)), middle], dim=1))
        yield layers[50](layers[49](x))
        x = layers[56](torch.cat([_upsampled(layers[53](x)), fine], dim=1))
        yield layers[58](layers[57](x))


class YoloTiny(Yolo):
    """YOLOv3-tiny, with grids of 32 and 16 pixels per cell; each anchor occurs twice, for people and teddy bears."""

    LAYERS: ClassVar = {
        1: (3, 16, 3, 1), 3: (16, 32, 3, 1), 5: (32, 64, 3, 1), 7: (64, 128, 3, 1), 9: (128, 256, 3, 1),
        11: (256, 512, 3, 1), 13: (512, 1024, 3, 1), 14: (1024, 256, 1, 1),
        15: (256, 512, 3, 1), 16: (512, 36, 1, 1),
        19: (256, 128, 1, 1), 22: (384, 256, 3, 1), 23: (256, 36, 1, 1),
    }  # fmt: skip
    GRIDS = (2 * ((81, 82), (135, 169), (344, 319)), 2 * ((10, 14), (23, 27), (37, 58)))

    def heads(self, images: Tensor) -> Iterator[Tensor]:
        """See :meth:`Yolo.heads`."""
        layers = self.layers
        x = images
        for number in (1, 3, 5, 7, 9):
            feature = layers[number](x)
            x = functional.max_pool2d(feature, 2)
        # The last pooling keeps the size; where its window crosses the edge, only the pixels inside count.
        x = functional.pad(layers[11](x), (0, 1, 0, 1), value=float("-inf"))
        x = layers[14](layers[13](functional.max_pool2d(x, 2, stride=1)))
        yield layers[16](layers[15](x))
        yield layers[23](layers[22](torch.cat([_upsampled(layers[19](x)), feature], dim=1)))


def load_shipped(path: Path) -> tuple[YoloSmall, YoloTiny]:
    """The arena network and the COCO network of the shipped safetensors.

    Raises:
        InputError: the file does not exist, belongs to other networks, holds invalid numbers, or does not match the
            hash in the ``.sha256`` file next to it, if any, which has the format of ``sha256sum``.
    """
    check_hash(path)
    wanted: dict[str, Tensor] = {}
    for number, (channels, filters, size, _) in (YoloSmall.LAYERS | YoloTiny.LAYERS).items():
        # The last layers before a grid have a bias for each number of each anchor; all others have normalisation.
        is_last = filters in (3 * (OBJECTNESS + 2), 6 * (OBJECTNESS + 2))
        norm = ("norm.bias", "norm.weight", "norm.running_mean", "norm.running_var")
        wanted[f"layers.{number}.conv.weight"] = torch.empty(filters, channels, size, size)
        for name in ("conv.bias",) if is_last else norm:
            wanted[f"layers.{number}.{name}"] = torch.empty(filters)
    # Layer 0 only copies the image.
    tensors = {name: tensor for name, tensor in read_tensors(path)[0].items() if not name.startswith("layers.0.")}
    copy_tensors(tensors, wanted, path)
    return YoloSmall(wanted), YoloTiny(wanted)


def decode(head: NDArray[np.float32], anchors: Anchors, width: int, height: int, threshold: float) -> ScoredBoxes:
    """Decode the boxes of one grid with the equations of section 2.1 of YOLOv3.

    Args:
        head: (anchors · numbers, H, W) output of the network for this grid.
        anchors: the grid's anchors.
        width, height: size of the network's input, pixels.
        threshold: minimum objectness, greater than 0.

    Returns:
        (N, 4) boxes in the network's input, pixels, and (N, 1) objectness times the probability of the class.
    """
    rows, columns = head.shape[1:]
    cells = head.reshape(len(anchors), -1, rows, columns)
    anchor, y, x = np.nonzero(cells[:, OBJECTNESS] >= logit(threshold))
    found = cells[anchor, :, y, x]
    shares = expit(found)
    middle = (shares[:, :2] + np.stack([x, y], axis=1)) * (width / columns, height / rows)
    half = np.exp(np.minimum(found[:, 2:OBJECTNESS], MAX_EXPONENT)) * np.array(anchors)[anchor] / 2
    boxes = np.concatenate([middle - half, middle + half], axis=1)
    return boxes.astype(np.float32), shares[:, OBJECTNESS + 1 :] * shares[:, OBJECTNESS, None]


def _upsampled(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2, mode="nearest")
