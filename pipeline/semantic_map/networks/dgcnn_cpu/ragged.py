"""DGCNN for training: blocks of different sizes, concatenated in one array of points."""

from typing import cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import batch_norm, leaky_relu

from pipeline.semantic_map.networks.dgcnn import GRAPH_CHANNELS, SLOPE, Dgcnn, EdgeConv, nearest
from pipeline.semantic_map.networks.dgcnn_cpu.inference import neighbour_finder, tiles
from pipeline.semantic_map.networks.dgcnn_cpu.training_functions import LargestLinear, LargestOfTwoLayers, LargestSum
from pipeline.semantic_map.networks.layers import to_points


class RaggedDgcnn(nn.Module):
    """DGCNN's forward pass in training. An EdgeConv's first layer is applied to points, as A x_j + B x_i."""

    def __init__(self, network: Dgcnn) -> None:
        """Share the weights of ``network``."""
        super().__init__()
        self.network = network

    def forward(self, points: Tensor, sizes: list[int]) -> Tensor:
        """(P, channels) points of blocks with ``sizes`` points each, P in sum, to (P, classes) logits."""
        network = self.network
        x, local = points, []
        graph = points[:, -GRAPH_CHANNELS:].contiguous()
        for conv in network.edge_convs:
            x = graph = edge_conv(conv, x, neighbours(graph, sizes, network.k))
            local.append(x)
        x = torch.cat(local, dim=1)
        everything = largest(network.embedding, x, sizes)
        of_everything, of_local = _weight(network.head1).split((everything.shape[1], x.shape[1]), dim=1)
        x = _activate(network.head1, x @ of_local.T + to_points(everything @ of_everything.T, sizes))
        x = _activate(network.head2, x @ _weight(network.head2).T)
        return network.dropout(x) @ network.classifier.weight.flatten(start_dim=1).T


@torch.no_grad()
def neighbours(x: Tensor, sizes: list[int], k: int) -> Tensor:
    """(P, k) int32 indices of the k points of the same block that are nearest in (P, C) features."""
    starts = np.cumsum([0, *sizes])
    blocks = zip(x.split(sizes), starts, strict=False)
    return torch.cat([_neighbours_in_block(block, k) + int(start) for block, start in blocks])


def edge_conv(conv: EdgeConv, x: Tensor, neighbours: Tensor) -> Tensor:
    """(P, C) features and (P, k) neighbours to (P, C') features."""
    first, *rest = (cast(nn.Sequential, layer) for layer in conv.layers)
    of_difference, of_point = _weight(first).chunk(2, dim=1)
    a, b = x @ of_difference.T, x @ (of_point - of_difference).T
    if not on_cpu(x):
        return _edge_conv_anywhere(first, rest, a, b, neighbours)
    norm, js = _norm(first), neighbours.numpy()
    if not rest:
        return cast(Tensor, LargestSum.apply(a, b, norm.weight, norm.bias, js, norm))
    norm2 = _norm(rest[0])
    parameters = norm.weight, norm.bias, _weight(rest[0]), norm2.weight, norm2.bias
    return cast(Tensor, LargestOfTwoLayers.apply(a, b, js, (norm, norm2), *parameters))


def largest(layer: nn.Sequential, x: Tensor, sizes: list[int]) -> Tensor:
    """(P, C) features to the (B, C') maximum responses of a layer over every block."""
    if not on_cpu(x):
        responses = _activate(layer, x @ _weight(layer).T)
        return torch.stack([block.amax(dim=0) for block in responses.split(sizes)])
    norm = _norm(layer)
    return cast(Tensor, LargestLinear.apply(x, _weight(layer), norm.weight, norm.bias, sizes, norm))


def on_cpu(x: Tensor) -> bool:
    """Whether the layers made for a CPU can be used."""
    return x.device.type == "cpu"


def _edge_conv_anywhere(
    first: nn.Sequential, rest: list[nn.Sequential], a: Tensor, b: Tensor, neighbours: Tensor
) -> Tensor:
    count, k = neighbours.shape
    edges = a[neighbours.flatten().long()].view(count, k, -1) + b[:, None]
    edges = _activate(first, edges.flatten(end_dim=1))
    for layer in rest:
        edges = _activate(layer, edges @ _weight(layer).T)
    return edges.view(count, k, -1).amax(dim=1)


def _neighbours_in_block(x: Tensor, k: int) -> Tensor:
    if not on_cpu(x):
        return nearest(x.T[None], k)[0].int()
    find = neighbour_finder(x, k)
    return torch.from_numpy(np.concatenate([find(rows) for rows in tiles(len(x))]))


def _weight(layer: nn.Sequential) -> Tensor:
    return cast(Tensor, layer[0].weight).flatten(start_dim=1)


def _norm(layer: nn.Sequential) -> nn.BatchNorm1d:
    return cast(nn.BatchNorm1d, layer[1])


def _activate(layer: nn.Sequential, x: Tensor) -> Tensor:
    norm = _norm(layer)
    running, momentum = (norm.running_mean, norm.running_var), cast(float, norm.momentum)
    x = batch_norm(x, *running, norm.weight, norm.bias, norm.training, momentum, norm.eps)
    return leaky_relu(x, SLOPE)
