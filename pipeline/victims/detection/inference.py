"""Inference with the networks on the robot's CPU.

Batch normalization is folded into the convolution, which also applies the activation; kernels are stored in oneDNN's
layout, and images have their channels last. These are the operators that torch.compile calls on a CPU; calling them
directly needs no C++ compiler on the robot, and saves a minute of compiling.
"""

from copy import deepcopy
from itertools import islice

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pipeline.arrays import Rgb
from pipeline.errors import required
from pipeline.victims.detection.boxes import Boxes, decode, joined
from pipeline.victims.detection.input_image import Letterbox
from pipeline.victims.detection.yolo import LEAKY_SLOPE, Convolution, Yolo


class FusedYolo:
    """A faster :class:`Yolo` in evaluation mode, for one image at a time, of any size."""

    def __init__(self, network: Yolo) -> None:
        """Copy the weights of a network, which stays unchanged."""
        self._network = deepcopy(network).eval()
        for parent in list(self._network.modules()):
            for name, module in parent.named_children():
                if isinstance(module, Convolution):
                    parent.add_module(name, _FusedConvolution(module))

    def boxes(self, image: Rgb, size: tuple[int, int], least: float, heads: int | None = None) -> Boxes:
        """Boxes of people in an image, pixels, several per person, and their (N, 1) confidences.

        Args:
            image: the image, of any size.
            size: width and height of the input into which it is fitted, pixels, multiples of 32.
            least: minimum objectness of a box.
            heads: number of heads to compute, the coarsest first; by default all.
        """
        letterbox, canvas = Letterbox.fit(image, *size)
        with torch.inference_mode():
            answers = [head[0].numpy() for head in islice(self._network.heads(to_tensor(canvas[None])), heads)]
        grids = zip(answers, self._network.grids, strict=False)
        boxes, scores = joined(decode(answer, grid, *size, least) for answer, grid in grids)
        return letterbox.to_image(boxes), scores


class _FusedConvolution(nn.Module):
    """Convolution, batch normalization and activation as one operator."""

    def __init__(self, layer: Convolution) -> None:
        super().__init__()
        conv = layer.conv
        kernel, self._bias = _folded(layer)
        self._kernel = kernel.cpu().contiguous(memory_format=torch.channels_last)
        self._window = (list(conv.padding), list(conv.stride), list(conv.dilation), conv.groups)
        self._kernels: dict[torch.Size, Tensor] = {}  # By shape of the input
        self._activation = ("none", []) if layer.norm is None else ("leaky_relu", [LEAKY_SLOPE])

    def forward(self, x: Tensor) -> Tensor:
        """(N, C, H, W) in and out."""
        if x.shape not in self._kernels:  # oneDNN would convert the layout for another shape at every call
            reorder = torch.ops.mkldnn._reorder_convolution_weight
            self._kernels[x.shape] = reorder(self._kernel, *self._window, list(x.shape))
        fused = torch.ops.mkldnn._convolution_pointwise
        result: Tensor = fused(x, self._kernels[x.shape], self._bias, *self._window, *self._activation, "")
        return result


@torch.no_grad()
def _folded(layer: Convolution) -> tuple[Tensor, Tensor]:
    """Kernel (filters, channels, size, size) and bias (filters,) with the batch normalization folded in."""
    conv, norm = layer.conv, layer.norm
    if norm is None:
        return conv.weight.clone(), required(conv.bias).clone()
    # In double precision: a variance close to 0 gives factors that float32 rounds badly.
    scale = norm.weight.double() / (required(norm.running_var).double() + norm.eps).sqrt()
    bias = norm.bias.double() - scale * required(norm.running_mean).double()
    return conv.weight * scale.float()[:, None, None, None], bias.float()


def to_tensor(images: NDArray[np.uint8]) -> Tensor:
    """(N, 3, H, W) float32 from 0 to 1, with channels last in memory, from (N, H, W, 3) uint8 images."""
    return torch.from_numpy(np.ascontiguousarray(images)).permute(0, 3, 1, 2).float().div_(255)
