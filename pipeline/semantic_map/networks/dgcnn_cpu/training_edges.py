"""The first layer's responses on all edges, which are summed up and made tile by tile, never stored."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pipeline.semantic_map.networks.dgcnn_cpu import inference_kernels
from pipeline.semantic_map.networks.dgcnn_cpu import training_kernels as kernels
from pipeline.semantic_map.networks.dgcnn_cpu.inference import SLOPE32, TILE
from pipeline.semantic_map.networks.dgcnn_cpu.training_norm import Norm


@dataclass(frozen=True, eq=False)
class Edges:
    """The responses a_j + b_i on all edges, by their sums.

    Attributes:
        a, b: (N, C) float32.
        neighbours: (N, k) int32, the j of every i.
        total, total_square: (C,) float64 over all edges.
        of_neighbours: (N, C) float32 sum of a_j over the neighbours of i.
        of_askers: (N, C) float32 sum of b_i over those whose neighbour is j.
        degree: (N, 1) float32 number of those.
    """

    a: Tensor
    b: Tensor
    neighbours: NDArray[np.int32]
    total: NDArray[np.float64]
    total_square: NDArray[np.float64]
    of_neighbours: Tensor
    of_askers: Tensor
    degree: Tensor

    @classmethod
    def of(cls, a: Tensor, b: Tensor, neighbours: NDArray[np.int32]) -> "Edges":
        count, channels = a.shape
        totals = np.zeros(channels), np.zeros(channels)
        sums = torch.zeros(count, channels), torch.zeros(count, channels), torch.zeros(count)
        kernels.edge_moments(a.numpy(), b.numpy(), neighbours, *totals, *(sum_.numpy() for sum_ in sums))
        return cls(a, b, neighbours, *totals, sums[0], sums[1], sums[2][:, None])

    def norm(self, sign: Tensor, norm: nn.BatchNorm1d) -> Norm:
        """Batch norm over all edges."""
        return Norm.of(self.total, self.total_square, self.neighbours.size, sign, norm)

    def activated(self, norm: Norm) -> "ActivatedEdges":
        """All edges after batch norm and LeakyReLU."""
        return ActivatedEdges(
            self, norm, (self.a * norm.scale).numpy(), (self.b * norm.scale + norm.shift).numpy()
        )

    def less_affine(
        self, to_a: Tensor, to_b: Tensor, constant: Tensor, factor: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Take from the gradients of a and b what batch norm takes from every edge: constant + factor · response."""
        k = self.neighbours.shape[1]
        to_a = to_a - self.degree * constant - factor * (self.degree * self.a + self.of_askers)
        to_b = to_b - k * constant - factor * (self.of_neighbours + k * self.b)
        return to_a, to_b


@dataclass(frozen=True, eq=False)
class ActivatedEdges:
    """LeakyReLU(norm(a_j + b_i)) on all edges, made tile by tile.

    Attributes:
        edges: before batch norm.
        norm: theirs.
        a, b: (N, C) float32, batch norm folded in.
    """

    edges: Edges
    norm: Norm
    a: NDArray[np.float32]
    b: NDArray[np.float32]

    def tile(self, rows: slice) -> Tensor:
        """(R k, C) of some of the points."""
        neighbours = self.edges.neighbours[rows]
        result = np.empty((neighbours.size, self.a.shape[1]), np.float32)
        inference_kernels.sum_edges(self.a, self.b[rows], neighbours, SLOPE32, result)
        return torch.from_numpy(result)

    def backward(self) -> "EdgeGradients":
        """Nothing yet."""
        sums = np.zeros(self.a.shape[1]), np.zeros(self.a.shape[1])
        return EdgeGradients(self.norm, torch.zeros(self.a.shape), torch.zeros(self.a.shape), *sums)


@dataclass(frozen=True, eq=False)
class EdgeGradients:
    """What comes back through the activated edges, summed up.

    Attributes:
        norm: of the edges.
        to_a, to_b: (N, C) float32, behind the activation.
        total, total_response: (C,) float64 sums over all edges, the latter times the response.
    """

    norm: Norm
    to_a: Tensor
    to_b: Tensor
    total: NDArray[np.float64]
    total_response: NDArray[np.float64]

    def add(self, edges: Edges, rows: slice, h: Tensor, to_h: Tensor) -> None:
        """The gradient of some of the points' (R k, C) activated edges h."""
        kernels.backward_through_edges(
            edges.a.numpy(), edges.b.numpy(), rows.start, edges.neighbours, h.numpy(), to_h.numpy(), SLOPE32,
            self.to_a.numpy(), self.to_b.numpy(), self.total, self.total_response,
        )  # fmt: skip

    def finish(self, edges: Edges) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Gradients of a, b, γ and β."""
        norm = self.norm
        to_beta = torch.from_numpy(self.total).float()
        mean, sigma = norm.mean.double().numpy(), norm.sigma.double().numpy()
        to_gamma = torch.from_numpy((self.total_response - mean * self.total) / sigma).float()
        affine = norm.affine(to_gamma, to_beta)
        return *edges.less_affine(self.to_a * norm.scale, self.to_b * norm.scale, *affine), to_gamma, to_beta


def tiles(count: int) -> list[slice]:
    """Slices of TILE rows."""
    return [slice(start, min(start + TILE, count)) for start in range(0, count, TILE)]
