"""DGCNN's forward pass for one block on the CPU: several times faster than in PyTorch, and as accurate."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from pipeline.errors import InputError
from pipeline.semantic_map.networks.dgcnn import GRAPH_CHANNELS, MAX_NEIGHBOURS, SLOPE, Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu import inference_kernels as kernels
from pipeline.semantic_map.networks.network import check_block
from pipeline.semantic_map.networks.threads import Threads

TILE_ROWS = 64
"""Number of points per tile: their data, mainly 1 MB of distances to 4,096 points, stay in the cache."""
SLOPE32 = np.float32(SLOPE)

Features = NDArray[np.float32]
Neighbours = NDArray[np.int32]
Responses = Callable[[slice, Neighbours, Features], None]
"""Function that fills in the (R, C) features of the points in a slice, given their (R, k) neighbours."""


class FastDgcnn:
    """A trained DGCNN, ready for inference.

    An EdgeConv's first layer is linear in [x_j − x_i, x_i], so it is applied to points, and its output for an edge is
    the sum A x_j + B x_i. A layer after an activation must be applied to every edge. The very first layer is applied
    to every edge, too, because it has few channels, and A x_j + B x_i would round away the small differences between
    neighbours. The maximum is taken before batch norm and activation, which are monotonic. The global feature is the
    same for all points, so its part of the next layer is computed once.
    """

    def __init__(self, network: Dgcnn, threads: int | None = None) -> None:
        """Prepare a network that is on the CPU; ``threads`` defaults to PyTorch's number (``OMP_NUM_THREADS``).

        Raises:
            InputError: k is too large.
        """
        if network.k > MAX_NEIGHBOURS:
            raise InputError(f"DGCNN with k = {network.k} neighbours: k must be at most {MAX_NEIGHBOURS}")
        self._network, self.k = network, network.k
        self.classes, self.min_points = network.classes, network.min_points
        self._threads = Threads(threads or torch.get_num_threads())
        self._conv1, self._conv2, self._conv3 = (
            [_Layer.of(cast(nn.Sequential, layer)) for layer in conv.layers] for conv in network.edge_convs
        )
        self._embedding = _Layer.of(network.embedding).folded()
        self._head1, self._head2 = _Layer.of(network.head1).folded(), _Layer.of(network.head2).folded()
        self._classifier = network.classifier.weight.detach()

    def __call__(self, points: Features) -> Features:
        """(N, classes) float32 logits of (N, channels) float32 points.

        Raises:
            InputError: the number of channels is wrong, there are fewer than k points, or the points are not finite.
        """
        check_block(self._network, points)
        return self._threads.run(lambda: self._logits(torch.from_numpy(np.ascontiguousarray(points))).numpy())

    def of_blocks(self, blocks: Iterable[Features]) -> Iterator[Features]:
        """The logits of every block in turn; the threads share each block's rows."""
        return map(self, blocks)

    def _logits(self, x: Tensor) -> Tensor:
        x1 = self._edge_conv(x[:, -GRAPH_CHANNELS:].contiguous(), self._first(x), len(self._conv1[1].weight))
        x2 = self._edge_conv(x1, self._second(x1), len(self._conv2[1].weight))
        x3 = self._edge_conv(x2, self._third(x2), len(self._conv3[0].weight))
        return self._segment(torch.cat((x1, x2, x3), dim=1))

    def _edge_conv(self, graph: Tensor, responses: Responses, channels: int) -> Tensor:
        """(N, channels) features; neighbours are the nearest points by the (N, C) features ``graph``."""
        find = neighbour_finder(graph, self.k)
        features = np.empty((len(graph), channels), np.float32)
        self._threads.over(tiles(len(graph)), lambda rows: responses(rows, find(rows), features[rows]))
        return torch.from_numpy(features)

    def _first(self, x: Tensor) -> Responses:
        first, last = self._conv1
        points, scale, shift = x.numpy(), first.scale.numpy(), first.shift.numpy()

        def responses(rows: slice, neighbours: Neighbours, features: Features) -> None:
            differences = np.empty((neighbours.size, 2 * points.shape[1]), np.float32)
            kernels.difference_edges(points, rows.start, neighbours, differences)
            edges = linear(torch.from_numpy(differences), first.weight).numpy()
            kernels.normalize_edges(edges, scale, shift, SLOPE32)
            last.largest(edges, features)

        return responses

    def _second(self, x: Tensor) -> Responses:
        first, last = self._conv2
        of_neighbour, of_point = first.split(x)

        def responses(rows: slice, neighbours: Neighbours, features: Features) -> None:
            edges = np.empty((neighbours.size, of_point.shape[1]), np.float32)
            kernels.sum_edges(of_neighbour, of_point[rows], neighbours, SLOPE32, edges)
            last.largest(edges, features)

        return responses

    def _third(self, x: Tensor) -> Responses:
        """An EdgeConv of one layer: batch norm and activation follow the maximum."""
        of_neighbour, of_point = self._conv3[0].split(x)

        def responses(rows: slice, neighbours: Neighbours, features: Features) -> None:
            kernels.largest_sum(of_neighbour, of_point[rows], neighbours, SLOPE32, features)

        return responses

    def _segment(self, local: Tensor) -> Tensor:
        """(N, classes) logits from the (N, 192) features of the three EdgeConvs."""
        weight, bias = self._embedding
        largest, rows_of_tiles = list[Tensor](), tiles(len(local))
        self._threads.over(rows_of_tiles, lambda rows: largest.append(linear(local[rows], weight).amax(dim=0)))
        everything = leaky_relu(torch.stack(largest).amax(dim=0) + bias, SLOPE)
        weight, bias = self._head1
        of_everything, of_local = weight[:, : len(everything)], weight[:, len(everything) :].contiguous()
        bias = bias + of_everything @ everything
        logits = torch.empty(len(local), self.classes)

        def tile(rows: slice) -> None:
            x = leaky_relu(linear(local[rows], of_local, bias), SLOPE)
            x = leaky_relu(linear(x, *self._head2), SLOPE)
            logits[rows] = linear(x, self._classifier)

        self._threads.over(rows_of_tiles, tile)
        return logits


def neighbour_finder(x: Tensor, k: int) -> Callable[[slice], Neighbours]:
    """A function that finds, by brute force, (R, k) indices of the points of x (N, C) nearest to R of them."""
    # Summed in the same order as in dgcnn.nearest, because rounding in another order may give other neighbours.
    half_square = (x.T.contiguous().square().sum(dim=0) / 2).numpy()

    def find(rows: slice) -> Neighbours:
        product = linear(x[rows], x).numpy()
        result = np.empty((len(product), k), np.int32)
        kernels.select_nearest(product, half_square, result)
        return result

    return find


def tiles(count: int) -> list[slice]:
    """Slices of at most TILE_ROWS rows that together cover ``count`` rows."""
    return [slice(start, min(start + TILE_ROWS, count)) for start in range(0, count, TILE_ROWS)]


def linear(x: Tensor, weight: Tensor, bias: Tensor | None = None) -> Tensor:
    """``x Wᵀ + b``, computed with oneDNN.

    On AMD, oneDNN is twice as fast for float32 as MKL, which torch.nn.functional.linear uses.
    """
    return torch.ops.mkldnn._linear_pointwise(x, weight, bias, "none", [], "")


@dataclass(frozen=True, eq=False)
class _Layer:
    """A linear map and batch norm, scale · W x + shift, without negative scales.

    Attributes:
        weight: (outputs, inputs) float32; a row and its scale are negated if the scale would be negative.
        scale: (outputs,) float32.
        shift: (outputs,) float32.
    """

    weight: Tensor
    scale: Tensor
    shift: Tensor

    @classmethod
    def of(cls, layer: nn.Sequential) -> "_Layer":
        weight, norm = cast(nn.Linear, layer[0]).weight.detach(), cast(nn.BatchNorm1d, layer[1])
        mean, variance = cast(Tensor, norm.running_mean), cast(Tensor, norm.running_var)
        # Rounded as in PyTorch's batch norm.
        scale = torch.rsqrt(variance + norm.eps) * norm.weight.detach()
        shift = norm.bias.detach().double() - mean.double() * scale.double()
        sign = torch.where(scale < 0, -1.0, 1.0)
        return cls(weight * sign[:, None], scale.abs(), shift.float())

    def largest(self, edges: Features, features: Features) -> None:
        """Fill ``features`` (R, outputs) with the largest response to the (R k, inputs) edges of each of R points."""
        responses = linear(torch.from_numpy(edges), self.weight).numpy()
        kernels.largest_edge(responses, self.scale.numpy(), self.shift.numpy(), SLOPE32, features)

    def folded(self) -> tuple[Tensor, Tensor]:
        """Weight and bias of one linear map that includes batch norm."""
        return self.weight * self.scale[:, None], self.shift

    def split(self, x: Tensor) -> tuple[Features, Features]:
        """(N, outputs) A x and B x + shift for (N, C) features; A x_j + B x_i + shift is the response to an edge."""
        weight, bias = self.folded()
        of_difference, of_point = weight.chunk(2, dim=1)
        of_neighbour = linear(x, of_difference.contiguous())
        return of_neighbour.numpy(), linear(x, of_point - of_difference, bias).numpy()
