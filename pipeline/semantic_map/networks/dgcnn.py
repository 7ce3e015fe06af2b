"""DGCNN for semantic segmentation, as published: one column of points in, the logits of every point out."""

import re
from collections.abc import Mapping
from typing import Self, cast

import torch
from torch import Tensor, nn

from pipeline.semantic_map.networks.network import MOST_CHANNELS, PointNetwork, whole

SLOPE = 0.2
"""Of LeakyReLU below 0."""
MOST_NEIGHBOURS = 64
"""Greatest k that ``dgcnn_cpu`` supports."""
EDGE_FEATURES, GLOBAL = 64, 1024
"""Features of a point after each EdgeConv, and of a block."""
NEAREST_POINTS = 20
"""Of a point, itself included, unless a file has another k."""
GRAPH_CHANNELS = 3
"""Number of channels, the last ones (normalized x, y, z), on which the first neighbour graph is built."""


class EdgeConv(nn.Module):
    """EdgeConv: the maximum response of a small network over the edges from a point to its neighbours."""

    def __init__(self, channels: int, *widths: int) -> None:
        """``widths`` are those of the network's layers; an edge has twice as many channels as a point."""
        super().__init__()
        pairs = zip((2 * channels, *widths), widths, strict=False)
        self.layers = nn.ModuleList(_layer(nn.Conv2d, *pair) for pair in pairs)

    def forward(self, x: Tensor, neighbours: Tensor) -> Tensor:
        """(B, C, N) features and (B, N, k) neighbours to (B, C', N) features."""
        edges = edge_features(x, neighbours)
        for layer in self.layers:
            edges = layer(edges)
        return edges.amax(dim=-1)


class Dgcnn(PointNetwork):
    """The segmentation network: three EdgeConvs, a global feature, and three layers on both for each point.

    Attributes:
        k: number of neighbours of a point, itself included.
    """

    NAME = "dgcnn"

    def __init__(self, channels: int, classes: int, k: int = NEAREST_POINTS) -> None:
        """Random weights; ``channels`` of a point are x, y, z and more, the last three normalized x, y, z."""
        super().__init__(channels, classes)
        self.k = k
        self.edge_conv1 = EdgeConv(channels, EDGE_FEATURES, EDGE_FEATURES)
        self.edge_conv2 = EdgeConv(EDGE_FEATURES, EDGE_FEATURES, EDGE_FEATURES)
        self.edge_conv3 = EdgeConv(EDGE_FEATURES, EDGE_FEATURES)
        local, half, last = 3 * EDGE_FEATURES, GLOBAL // 2, GLOBAL // 4
        self.embedding = _layer(nn.Conv1d, local, GLOBAL)
        self.head1 = _layer(nn.Conv1d, GLOBAL + local, half)
        self.head2 = _layer(nn.Conv1d, half, last)
        self.dropout = nn.Dropout()
        self.classifier = nn.Conv1d(last, classes, kernel_size=1, bias=False)

    @property
    def fewest(self) -> int:
        """Least number of points of a block: as many as a point has neighbours."""
        return self.k

    @classmethod
    def for_weights(cls, tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> Self:
        """A network of the size of published weights, with the metadata's k; ValueError if they are of no DGCNN."""
        k = whole(metadata.get("k", str(NEAREST_POINTS)))
        if not 1 <= k <= MOST_NEIGHBOURS:
            raise ValueError(f"k = {metadata['k']:.20}: a point has 1 to {MOST_NEIGHBOURS} neighbours")
        first, last = (tuple(tensors[n].shape) if n in tensors else () for n in ("conv1.0.weight", "conv9.weight"))
        # Shapes need bounds: a tensor with a 0 in its shape takes no bytes of a file, whatever its other sizes.
        if len(first) != 4 or not 2 * GRAPH_CHANNELS <= first[1] <= 2 * MOST_CHANNELS or first[0] != EDGE_FEATURES:
            raise ValueError(f"not a DGCNN for segmentation: conv1.0.weight is {first}")
        if len(last) != 3 or not 1 <= last[0] <= MOST_CHANNELS:
            raise ValueError(f"not a DGCNN for segmentation: conv9.weight is {last}")
        return cls(first[1] // 2, last[0], k)

    def about(self) -> dict[str, str]:
        """The number of neighbours, which no tensor's shape gives."""
        return {"k": str(self.k)}

    def file_names(self, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
        """The tensors without the batch norms that the published code registers twice, as bn1 and as conv1.1."""
        return {name: t for name, t in tensors.items() if not re.match(r"conv\d\.1\.", name)}

    def published(self) -> dict[str, Tensor]:
        """All parameters and running statistics by their names in published files (antao97/dgcnn.pytorch)."""
        layers = [cast(nn.Sequential, layer) for conv in self.edge_convs for layer in conv.layers]
        tensors = {"conv9.weight": self.classifier.weight.data}
        for number, layer in enumerate([*layers, self.embedding, self.head1, self.head2], start=1):
            tensors[f"conv{number}.0.weight"] = cast(Tensor, layer[0].weight).data
            statistics = layer[1].state_dict().items()
            tensors |= {f"bn{number}.{name}": tensor.data for name, tensor in statistics}
        return tensors

    @property
    def edge_convs(self) -> tuple[EdgeConv, EdgeConv, EdgeConv]:
        """The three EdgeConvs in order."""
        return self.edge_conv1, self.edge_conv2, self.edge_conv3

    def forward(self, points: Tensor) -> Tensor:
        """(B, channels, N) float32 points, N ≥ k, to (B, classes, N) logits."""
        x1 = self.edge_conv1(points, nearest(points[:, -GRAPH_CHANNELS:], self.k))
        x2 = self.edge_conv2(x1, nearest(x1, self.k))
        x3 = self.edge_conv3(x2, nearest(x2, self.k))
        local = torch.cat((x1, x2, x3), dim=1)
        everything = self.embedding(local).amax(dim=-1, keepdim=True)
        x = torch.cat((everything.expand(-1, -1, local.shape[-1]), local), dim=1)
        x = self.dropout(self.head2(self.head1(x)))
        return self.classifier(x)


def nearest(x: Tensor, k: int) -> Tensor:
    """(B, N, k) int64: the k points nearest to every point of (B, C, N), itself included, in no particular order."""
    product = x.transpose(1, 2) @ x
    square = (x * x).sum(dim=1)
    closeness = 2 * product - square[:, None, :] - square[:, :, None]
    return closeness.topk(k, dim=-1, sorted=False).indices


def edge_features(x: Tensor, neighbours: Tensor) -> Tensor:
    """(B, 2C, N, k): x_j − x_i and x_i for every point i and its neighbours j."""
    batch, channels, count = x.shape
    k = neighbours.shape[-1]
    flat = neighbours.reshape(batch, 1, count * k).expand(-1, channels, -1)
    x_j = x.gather(2, flat).reshape(batch, channels, count, k)
    x_i = x[..., None].expand_as(x_j)
    return torch.cat((x_j - x_i, x_i), dim=1)


def _layer(convolution: type[nn.Conv1d] | type[nn.Conv2d], inputs: int, outputs: int) -> nn.Sequential:
    """A linear map shared by all points or edges, batch norm, LeakyReLU."""
    norm = nn.BatchNorm1d if convolution is nn.Conv1d else nn.BatchNorm2d
    return nn.Sequential(convolution(inputs, outputs, kernel_size=1, bias=False), norm(outputs), nn.LeakyReLU(SLOPE))
