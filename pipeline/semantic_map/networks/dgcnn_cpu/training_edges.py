"""The first layer's responses on all edges, which are summed up and computed tile by tile but never stored."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pipeline.semantic_map.networks.dgcnn_cpu import inference_kernels
from pipeline.semantic_map.networks.dgcnn_cpu import training_kernels as kernels
from pipeline.semantic_map.networks.dgcnn_cpu.inference import SLOPE32
from pipeline.semantic_map.networks.dgcnn_cpu.training_norm import Norm


class Edges:
    """The responses a_j + b_i on all edges, by their sums.

    Attributes:
        a, b: (N, C) float32.
        neighbours: (N, k) int32, the j of every i.
        sums: (C,) float64 over all edges, of the responses and of their squares.
        of_neighbours: (N, C) float32 sum of a_j over the neighbours of i.
        of_origins: (N, C) float32 sum of b_i over the i whose neighbour is j.
        degree: (N, 1) float32 number of these i.
    """

    def __init__(self, a: Tensor, b: Tensor, neighbours: NDArray[np.int32]) -> None:
        """Compute the sums."""
        self.a, self.b, self.neighbours = a, b, neighbours
        self.sums = np.zeros(a.shape[1]), np.zeros(a.shape[1])
        self.of_neighbours, self.of_origins = torch.zeros_like(a), torch.zeros_like(a)
        self.degree = torch.zeros(len(a), 1)
        by_point = (self.of_neighbours.numpy(), self.of_origins.numpy(), self.degree[:, 0].numpy())
        kernels.edge_moments(a.numpy(), b.numpy(), neighbours, *self.sums, *by_point)

    def norm(self, sign: Tensor, norm: nn.BatchNorm1d) -> Norm:
        """Batch norm over all edges."""
        return Norm.of(self.sums, self.neighbours.size, sign, norm)

    def less_affine(self, to_a: Tensor, to_b: Tensor, constant: Tensor, factor: Tensor) -> tuple[Tensor, Tensor]:
        """Subtract from the gradients of a and b batch norm's part of every edge: constant + factor · response."""
        k = self.neighbours.shape[1]
        to_a = to_a - self.degree * constant - factor * (self.degree * self.a + self.of_origins)
        to_b = to_b - k * constant - factor * (self.of_neighbours + k * self.b)
        return to_a, to_b


class ActivatedEdges:
    """LeakyReLU(norm(a_j + b_i)) on all edges, computed tile by tile."""

    def __init__(self, edges: Edges, norm: Norm) -> None:
        """From the edges before batch norm, and their batch norm, which is folded into a and b."""
        self.edges, self.norm = edges, norm
        self._a, self._b = (edges.a * norm.scale).numpy(), (edges.b * norm.scale + norm.shift).numpy()

    def tile(self, rows: slice) -> Tensor:
        """(R k, C) activated edges of the points ``rows``."""
        neighbours = self.edges.neighbours[rows]
        result = np.empty((neighbours.size, self._a.shape[1]), np.float32)
        inference_kernels.sum_edges(self._a, self._b[rows], neighbours, SLOPE32, result)
        return torch.from_numpy(result)


class BackThroughEdges:
    """The backward pass through activated edges, summed up tile by tile."""

    def __init__(self, activated: ActivatedEdges) -> None:
        """All gradients are zero."""
        self._edges, self._norm = activated.edges, activated.norm
        self._to_a, self._to_b = torch.zeros_like(self._edges.a), torch.zeros_like(self._edges.b)
        channels = self._to_a.shape[1]
        self._total, self._total_response = np.zeros(channels), np.zeros(channels)

    def add(self, rows: slice, h: Tensor, to_h: Tensor) -> None:
        """Add ``to_h``, the gradient of the (R k, C) activated edges ``h`` of the points ``rows``."""
        kernels.backward_through_edges(
            self._edges.a.numpy(), self._edges.b.numpy(), rows.start, self._edges.neighbours, h.numpy(),
            to_h.numpy(), SLOPE32, self._to_a.numpy(), self._to_b.numpy(), self._total, self._total_response,
        )  # fmt: skip

    def gradients(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Gradients of a, b, γ and β."""
        norm, to_beta = self._norm, torch.from_numpy(self._total).float()
        mean, sigma = norm.mean.double().numpy(), norm.sigma.double().numpy()
        to_gamma = torch.from_numpy((self._total_response - mean * self._total) / sigma).float()
        affine = norm.affine(to_gamma, to_beta)
        to_a, to_b = self._edges.less_affine(self._to_a * norm.scale, self._to_b * norm.scale, *affine)
        return to_a, to_b, to_gamma, to_beta
