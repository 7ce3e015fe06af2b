"""Layers shared by point networks; they map rows of features to rows of features."""

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import linear


def mlp(*widths: int) -> nn.Sequential:
    """A shared MLP: a linear map, batch norm and ReLU of each row, for every width after the first."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(widths):
        layers += [nn.Linear(inputs, outputs, bias=False), nn.BatchNorm1d(outputs), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def max_over_edges(edges: Tensor, layers: nn.Module) -> Tensor:
    """(Q, C') maximum over the K edges of the output of ``layers`` for (Q, K, C) features of edges."""
    count, k, _ = edges.shape
    features = layers(edges.flatten(end_dim=1)).view(count, k, -1)
    # max is faster in the backward pass, amax in the forward pass.
    return features.max(dim=1).values if torch.is_grad_enabled() else features.amax(dim=1)


def max_over_blocks(features: Tensor, sizes: Sequence[int]) -> Tensor:
    """(B, C) maximum over each block of (P, C) features of points, in blocks of ``sizes`` points."""
    return torch.stack([block.max(dim=0).values for block in features.split(list(sizes))])


def broadcast_to_points(of_blocks: Tensor, sizes: Sequence[int]) -> Tensor:
    """(P, C) features of points, each of which gets the features of its block from ``of_blocks`` (B, C)."""
    return of_blocks.repeat_interleave(torch.tensor(sizes, device=of_blocks.device), dim=0)


def linear_of_points_and_blocks(
    layer: nn.Linear, features: Tensor, of_blocks: Tensor, sizes: Sequence[int]
) -> Tensor:
    """``layer`` applied to (P, C) features of points, each joined with the (B, D) features of its block."""
    own, common = layer.weight.split([features.shape[1], of_blocks.shape[1]], dim=1)
    return linear(features, own, layer.bias) + broadcast_to_points(linear(of_blocks, common), sizes)
