"""Batch normalization folded into the convolution before it."""

import torch
from torch import Tensor

from pipeline.victims.detection.network import DarknetConvolution


@torch.no_grad()
def folded(layer: DarknetConvolution) -> tuple[Tensor, Tensor]:
    """Kernel (filters, channels, size, size) and bias (filters,) that do what the layer does in evaluation."""
    conv, norm = layer.conv, layer.norm
    if norm is None:
        assert conv.bias is not None
        return conv.weight.clone(), conv.bias.clone()
    assert norm.running_mean is not None and norm.running_var is not None
    # In double precision: a variance of nearly nothing makes factors that float32 rounds badly.
    scale = norm.weight.double() / (norm.running_var.double() + norm.eps).sqrt()
    bias = norm.bias.double() - scale * norm.running_mean.double()
    return (conv.weight.double() * scale[:, None, None, None]).float(), bias.float()
