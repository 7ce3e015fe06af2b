"""The network for inference on the robot's processor.

Batch normalization is folded into the convolution, which also applies the activation; kernels are stored in oneDNN's
layout, and images have their channels last. These are the operators that torch.compile calls on a processor; called
directly, they need no C++ compiler on the robot and no minute of compiling.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pipeline.victims.detection.network import ACTIVATE, LEAKY_SLOPE, DarknetConvolution, DarknetNetwork

ONEDNN_ACTIVATIONS: dict[str, tuple[str, list[float]]] = {
    "linear": ("none", []),
    "leaky": ("leaky_relu", [LEAKY_SLOPE]),
    "relu": ("relu", []),
    "logistic": ("sigmoid", []),
    "swish": ("swish", []),
}
"""Name and parameters of the activations that oneDNN's convolution applies; others follow it."""


class FusedNetwork:
    """A faster :class:`DarknetNetwork` in evaluation mode, for one image at a time."""

    def __init__(self, network: DarknetNetwork) -> None:
        """Copy the weights of a network, which stays unchanged."""
        self.cfg = network.cfg
        self._network = DarknetNetwork(network.cfg).eval()
        shapes = [(self.cfg.channels, self.cfg.height, self.cfg.width), *network.shapes]
        modules = zip(network.layers, shapes[:-1], strict=True)
        self._network.layers = nn.ModuleList(
            _FusedConvolution(module, shape) if isinstance(module, DarknetConvolution) else module
            for module, shape in modules
        )

    def __call__(self, image: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
        """(anchors · (5 + classes), H, W) float32 input of each [yolo], from a (height, width, 3) uint8 image."""
        with torch.inference_mode():
            return [head[0].contiguous().numpy() for head in self._network(to_tensor(image[None]))]


class _FusedConvolution(nn.Module):
    """Convolution, batch normalization and activation as one operator."""

    def __init__(self, layer: DarknetConvolution, shape: tuple[int, int, int]) -> None:
        super().__init__()
        kernel, self._bias = _folded(layer)
        kernel = kernel.cpu().contiguous(memory_format=torch.channels_last)
        conv = layer.conv
        window = (list(conv.padding), list(conv.stride), list(conv.dilation), conv.groups)
        self._kernel = torch.ops.mkldnn._reorder_convolution_weight(kernel, *window, [1, *shape])
        self._window = window
        is_fused = layer.activation in ONEDNN_ACTIVATIONS
        self._activation = ONEDNN_ACTIVATIONS[layer.activation if is_fused else "linear"]
        self._activate = ACTIVATE["linear" if is_fused else layer.activation]

    def forward(self, x: Tensor) -> Tensor:
        """(1, C, H, W) in and out."""
        x = torch.ops.mkldnn._convolution_pointwise(x, self._kernel, self._bias, *self._window, *self._activation, "")
        return self._activate(x)


@torch.no_grad()
def _folded(layer: DarknetConvolution) -> tuple[Tensor, Tensor]:
    """Kernel (filters, channels, size, size) and bias (filters,) with the batch normalization folded in."""
    conv, norm = layer.conv, layer.norm
    if norm is None:
        assert conv.bias is not None
        return conv.weight.clone(), conv.bias.clone()
    assert norm.running_mean is not None and norm.running_var is not None
    # In double precision: a variance close to 0 gives factors that float32 rounds badly.
    scale = norm.weight.double() / (norm.running_var.double() + norm.eps).sqrt()
    bias = norm.bias.double() - scale * norm.running_mean.double()
    return (conv.weight.double() * scale[:, None, None, None]).float(), bias.float()


def to_tensor(images: NDArray[np.uint8]) -> Tensor:
    """(N, 3, H, W) float32 in 0 to 1, channels last in memory, from (N, H, W, 3) uint8 images."""
    return torch.from_numpy(np.ascontiguousarray(images)).permute(0, 3, 1, 2).float().div_(255)
