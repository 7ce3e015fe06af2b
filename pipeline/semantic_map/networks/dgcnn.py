"""DGCNN for semantic segmentation (Wang et al., ACM TOG 2019), as published."""

import re
from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Self, cast

import torch
from torch import Tensor, nn
from torch.nn.functional import linear

from pipeline.semantic_map.networks.layers import broadcast_to_points, max_over_blocks, max_over_edges
from pipeline.semantic_map.networks.network import MAX_CHANNELS, PointNetwork, whole_number

SLOPE = 0.2
"""Slope of LeakyReLU below 0."""
MAX_NEIGHBOURS = 64
"""Largest k that ``dgcnn_cpu`` supports."""
EDGE_FEATURES, GLOBAL = 64, 1024
"""Number of features of a point after each EdgeConv, and of a block."""
NEAREST_POINTS = 20
"""Number of neighbours of a point, itself included, unless a file specifies another k."""
GRAPH_CHANNELS = 3
"""Number of channels, the last ones (normalised x, y, z), on which the first neighbour graph is built."""


class EdgeConv(nn.Module):
    """EdgeConv: the maximum response of a small network over the edges from a point to its neighbours."""

    def __init__(self, channels: int, *widths: int) -> None:
        """``widths``: numbers of outputs of the layers; an edge has twice as many channels as a point."""
        super().__init__()
        self.layers = nn.Sequential(*(_layer(*pair) for pair in pairwise((2 * channels, *widths))))

    def forward(self, x: Tensor, neighbours: Tensor) -> Tensor:
        """(P, C') features of points with (P, C) features and (P, k) neighbours."""
        return max_over_edges(edge_features(x, neighbours), self.layers)


class Dgcnn(PointNetwork):
    """The segmentation network: three EdgeConvs, a global feature, and three layers that combine them for each point.

    Attributes:
        k: number of neighbours of a point, itself included.
    """

    NAME = "dgcnn"

    def __init__(self, channels: int, classes: int, k: int = NEAREST_POINTS) -> None:
        """Start with random weights; the first three channels are x, y, z, and the last three normalised x, y, z."""
        super().__init__(channels, classes)
        self.k = k
        self.edge_conv1 = EdgeConv(channels, EDGE_FEATURES, EDGE_FEATURES)
        self.edge_conv2 = EdgeConv(EDGE_FEATURES, EDGE_FEATURES, EDGE_FEATURES)
        self.edge_conv3 = EdgeConv(EDGE_FEATURES, EDGE_FEATURES)
        local, half, last = 3 * EDGE_FEATURES, GLOBAL // 2, GLOBAL // 4
        self.embedding = _layer(local, GLOBAL)
        self.head1 = _layer(GLOBAL + local, half)
        self.head2 = _layer(half, last)
        self.dropout = nn.Dropout()
        self.classifier = nn.Linear(last, classes, bias=False)

    @property
    def min_points(self) -> int:
        """Minimum number of points of a block, which is the number of neighbours of a point."""
        return self.k

    @classmethod
    def for_weights(cls, tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> Self:
        """A network that fits published weights, with the metadata's k.

        Raises:
            ValueError: the weights are not a DGCNN's, or k is out of range.
        """
        k = whole_number(metadata.get("k", str(NEAREST_POINTS)))
        if not 1 <= k <= MAX_NEIGHBOURS:
            text = metadata["k"]
            raise ValueError(
                f"k = {text!r:.20}: the number of neighbours must be a whole number from 1 to {MAX_NEIGHBOURS}"
            )
        names = "conv1.0.weight", "conv9.weight"
        if missing := [name for name in names if name not in tensors]:
            raise ValueError(f"not a DGCNN for segmentation: the tensor {missing[0]} is missing")
        first, last = (tuple(tensors[name].shape) for name in names)
        # Shapes need limits: a tensor with a 0 in its shape takes no bytes in a file, whatever its other sizes.
        if len(first) != 4 or not 2 * GRAPH_CHANNELS <= first[1] <= 2 * MAX_CHANNELS or first[0] != EDGE_FEATURES:
            raise ValueError(
                f"not a DGCNN for segmentation: {names[0]} has shape {first}, but must have "
                f"({EDGE_FEATURES}, C, 1, 1) with C even and from {2 * GRAPH_CHANNELS} to {2 * MAX_CHANNELS}"
            )
        if len(last) != 3 or not 1 <= last[0] <= MAX_CHANNELS:
            raise ValueError(
                f"not a DGCNN for segmentation: {names[1]} has shape {last}, but must have "
                f"(C, {GLOBAL // 4}, 1) with C from 1 to {MAX_CHANNELS}"
            )
        return cls(first[1] // 2, last[0], k)

    def metadata(self) -> dict[str, str]:
        """The number of neighbours, which does not follow from the shape of any tensor."""
        return {"k": str(self.k)}

    def without_duplicates(self, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
        """The tensors without the batch norms that the published code registers twice, as bn1 and as conv1.1."""
        return {name: t for name, t in tensors.items() if not re.match(r"conv\d\.1\.", name)}

    def file_tensors(self) -> dict[str, Tensor]:
        """All parameters and running statistics by their names in published files (antao97/dgcnn.pytorch).

        In those files, the layers are convolutions with kernels of size one, two-dimensional for edges.
        """
        on_edges = [cast(nn.Sequential, layer) for conv in self.edge_convs for layer in conv.layers]
        tensors = {"conv9.weight": self.classifier.weight.data[..., None]}
        for number, layer in enumerate([*on_edges, self.embedding, self.head1, self.head2], start=1):
            weight = cast(Tensor, layer[0].weight).data[..., None]
            tensors[f"conv{number}.0.weight"] = weight[..., None] if layer in on_edges else weight
            statistics = layer[1].state_dict().items()
            tensors |= {f"bn{number}.{name}": tensor.data for name, tensor in statistics}
        return tensors

    @property
    def edge_convs(self) -> tuple[EdgeConv, EdgeConv, EdgeConv]:
        """The three EdgeConvs in order."""
        return self.edge_conv1, self.edge_conv2, self.edge_conv3

    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, classes) logits of (P, channels) float32 points, in blocks of ``sizes`` points, at least k each."""
        x1 = self.edge_conv1(points, nearest(points[:, -GRAPH_CHANNELS:], sizes, self.k))
        x2 = self.edge_conv2(x1, nearest(x1, sizes, self.k))
        x3 = self.edge_conv3(x2, nearest(x2, sizes, self.k))
        local = torch.cat((x1, x2, x3), dim=1)
        everything = max_over_blocks(self.embedding(local), sizes)
        of_block, of_point = cast(Tensor, self.head1[0].weight).split([GLOBAL, local.shape[1]], dim=1)
        x = linear(local, of_point) + broadcast_to_points(linear(everything, of_block), sizes)
        return self.classifier(self.dropout(self.head2(self.head1[1:](x))))


@torch.no_grad()
def nearest(x: Tensor, sizes: Sequence[int], k: int) -> Tensor:
    """(P, k) int64 indices of the k points of the same block nearest to each point of x (P, C), itself included.

    The indices are not ordered by distance.
    """
    blocks = zip(x.split(list(sizes)), accumulate(sizes, initial=0), strict=False)
    return torch.cat([_nearest(block, k) + start for block, start in blocks])


def _nearest(x: Tensor, k: int) -> Tensor:
    square = x.T.contiguous().square().sum(dim=0)
    closeness = 2 * (x @ x.T) - square - square[:, None]
    return closeness.topk(k, dim=-1, sorted=False).indices


def edge_features(x: Tensor, neighbours: Tensor) -> Tensor:
    """(P, k, 2C): x_j − x_i and x_i for every point i and its neighbours j."""
    x_j = x[neighbours]
    x_i = x[:, None].expand_as(x_j)
    return torch.cat((x_j - x_i, x_i), dim=-1)


def _layer(inputs: int, outputs: int) -> nn.Sequential:
    """A linear map shared by all points or edges, batch norm and LeakyReLU."""
    return nn.Sequential(
        nn.Linear(inputs, outputs, bias=False), nn.BatchNorm1d(outputs), nn.LeakyReLU(SLOPE, inplace=True)
    )
