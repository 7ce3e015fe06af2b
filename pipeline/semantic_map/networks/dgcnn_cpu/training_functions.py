"""Layers for training on a CPU, several times as cheap as automatic differentiation of the network as written.

They take the maximum over groups of responses r of a linear map, after batch norm and activation. Both
are monotone, so they are applied to the maximum alone. In the backward pass, the gradient of a response is

    γ/σ · (the gradient of the maximum, where it was taken − mean of β's gradient − (r − μ)/σ · mean of γ's gradient),

a few entries and an affine map of r. So responses need not be stored: the affine map of r = W h is one of h.

``LargestLinear`` serves any network on points; the other two are EdgeConvs.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.autograd import Function

from pipeline.semantic_map.networks.dgcnn_cpu import training_kernels as kernels
from pipeline.semantic_map.networks.dgcnn_cpu.inference import linear, tiles
from pipeline.semantic_map.networks.dgcnn_cpu.training_edges import ActivatedEdges, BackThroughEdges, Edges
from pipeline.semantic_map.networks.dgcnn_cpu.training_norm import Largest, Norm, signs

Norms = tuple[nn.BatchNorm1d, nn.BatchNorm1d]


class LargestLinear(Function):
    """Maximum of LeakyReLU(norm(W x)) over the points of each block."""

    @staticmethod
    def forward(
        ctx: Any, x: Tensor, weight: Tensor, gamma: Tensor, beta: Tensor, sizes: list[int], norm: nn.BatchNorm1d
    ) -> Tensor:
        """(N, C) x, in blocks of ``sizes``, and (C', C) W to (B, C'); gamma and beta are those of ``norm``."""
        ctx.linear, ctx.sizes = _LargestResponses(weight, signs(gamma)), sizes
        ctx.save_for_backward(x)
        return ctx.linear.forward(_blocks(x, sizes), len(sizes), len(x), norm)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of x, W, γ and β."""
        (x,) = ctx.saved_tensors
        back = _BackThroughResponses(ctx.linear, gradients[0])
        to_x = torch.cat([back.to_input(rows, block) for rows, block in _blocks(x, ctx.sizes)])
        return to_x, *back.to_parameters(), None, None


class LargestSum(Function):
    """Maximum of LeakyReLU(norm(A x_j + B x_i)) over each point's neighbours j."""

    @staticmethod
    def forward(
        ctx: Any, a: Tensor, b: Tensor, gamma: Tensor, beta: Tensor, js: NDArray[np.int32], norm: nn.BatchNorm1d
    ) -> Tensor:
        """(N, C) A x_j and B x_i and (N, k) neighbours to (N, C); gamma and beta are those of ``norm``."""
        sign = signs(gamma)
        edges = Edges(a * sign, b * sign, js)
        responses, winners = np.empty(a.shape, np.float32), np.empty(a.shape, np.int32)
        kernels.largest_sums(edges.a.numpy(), edges.b.numpy(), js, responses, winners)
        ctx.largest = Largest(torch.from_numpy(responses), winners, edges.norm(sign, norm))
        ctx.edges, ctx.sign = edges, sign
        return ctx.largest.activated()

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of A x_j, B x_i, γ and β."""
        to_winners, to_gamma, to_beta = ctx.largest.backward(gradients[0])
        to_a = torch.zeros_like(to_winners)
        kernels.add_to_winners(to_winners.numpy(), ctx.largest.winners, ctx.edges.neighbours, to_a.numpy())
        to_a, to_b = ctx.edges.less_affine(to_a, to_winners, *ctx.largest.norm.affine(to_gamma, to_beta))
        return to_a * ctx.sign, to_b * ctx.sign, to_gamma * ctx.sign, to_beta, None, None


class LargestOfTwoLayers(Function):
    """Maximum of LeakyReLU(norm(W LeakyReLU(norm(A x_j + B x_i)))) over each point's neighbours j."""

    @staticmethod
    def forward(ctx: Any, a: Tensor, b: Tensor, js: NDArray[np.int32], norms: Norms, *rest: Tensor) -> Tensor:
        """(N, C) A x_j and B x_i, (N, k) neighbours to (N, C'); ``rest`` is γ1, β1, (C', C) W, γ2 and β2."""
        gamma1, _, weight, gamma2, _ = rest
        edges = Edges(a, b, js)
        ctx.activated = ActivatedEdges(edges, edges.norm(torch.ones_like(gamma1), norms[0]))
        ctx.linear = _LargestResponses(weight, signs(gamma2))
        h = ((rows, ctx.activated.tile(rows)) for rows in tiles(len(a)))
        return ctx.linear.forward(h, len(a), js.size, norms[1])

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of A x_j, B x_i, γ1, β1, W, γ2 and β2."""
        back, back_further = _BackThroughResponses(ctx.linear, gradients[0]), BackThroughEdges(ctx.activated)
        for rows in tiles(len(gradients[0])):
            h = ctx.activated.tile(rows)
            back_further.add(rows, h, back.to_input(rows, h))
        to_a, to_b, *to_norm1 = back_further.gradients()
        return to_a, to_b, None, None, *to_norm1, *back.to_parameters()


class _LargestResponses:
    """The maximum responses of W x over groups of rows x, computed piece by piece."""

    largest: Largest

    def __init__(self, weight: Tensor, sign: Tensor) -> None:
        """(C', C) W, and the (C',) signs of batch norm's γ, by which its rows are multiplied."""
        self.weight, self.sign = weight * sign[:, None], sign

    def forward(
        self, pieces: Iterable[tuple[slice, Tensor]], groups: int, count: int, norm: nn.BatchNorm1d
    ) -> Tensor:
        """(groups, C') activated maxima; a piece has the (R k, C) rows of R successive groups, ``count`` in all."""
        channels = len(self.weight)
        responses, winners = np.empty((groups, channels), np.float32), np.empty((groups, channels), np.int32)
        sums = np.zeros(channels), np.zeros(channels)
        for rows, x in pieces:
            kernels.largest_of_groups(linear(x, self.weight).numpy(), responses[rows], winners[rows], *sums)
        self.largest = Largest(torch.from_numpy(responses), winners, Norm.of(sums, count, self.sign, norm))
        return self.largest.activated()


class _BackThroughResponses:
    """The backward pass of :class:`_LargestResponses`: gradients of x, piece by piece, and of W, γ and β."""

    def __init__(self, responses: _LargestResponses, gradient: Tensor) -> None:
        """Compute what all pieces share; except at winners, the gradient of W x is −(constant + factor · W x)."""
        self._weight, self._sign, self._largest = responses.weight, responses.sign, responses.largest
        self._to_winners, self._to_gamma, self._to_beta = self._largest.backward(gradient)
        self._constant, factor = self._largest.norm.affine(self._to_gamma, self._to_beta)
        self._scaled = factor[:, None] * self._weight
        self._affine = -(self._weight.T @ self._scaled), -(self._constant @ self._weight)
        self._to_weight = torch.zeros_like(self._weight)
        channels = self._weight.shape[1]
        self._total, self._products = torch.zeros(channels), torch.zeros(channels, channels)

    def to_input(self, rows: slice, x: Tensor) -> Tensor:
        """The gradient of a piece x, which has the groups ``rows``."""
        to_x = linear(x, *self._affine)
        kernels.backward_through_winners(
            self._to_winners[rows].numpy(), self._largest.winners[rows], self._weight.numpy(), x.numpy(),
            to_x.numpy(), self._to_weight.numpy(),
        )  # fmt: skip
        self._total += x.sum(dim=0)
        self._products += x.T @ x
        return to_x

    def to_parameters(self) -> tuple[Tensor, Tensor, Tensor]:
        """Gradients of W, γ and β."""
        to_weight = self._to_weight - self._constant[:, None] * self._total - self._scaled @ self._products
        return to_weight * self._sign[:, None], self._to_gamma * self._sign, self._to_beta


def _blocks(x: Tensor, sizes: list[int]) -> Iterable[tuple[slice, Tensor]]:
    """The points of each block, with a slice that makes the block a group of its own."""
    return ((slice(b, b + 1), block) for b, block in enumerate(x.split(sizes)))
