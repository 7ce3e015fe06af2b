"""The network's layers for training on a CPU, several times as cheap as differentiating what is written.

Each takes the maximum over a group of responses r of a linear map, which are batch-normalized and activated. Both are
monotone, so they need the maximum alone. Going back, the gradient of a response is

    γ/σ · (the gradient of the maximum, where it was taken − mean of β's gradient − (r − μ)/σ · mean of γ's gradient),

a few entries and an affine map of r. So responses need not be kept, and the affine map of r = W h is one of h.
"""

from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.autograd import Function

from pipeline.semantic_map.networks.dgcnn_cpu import training_kernels as kernels
from pipeline.semantic_map.networks.dgcnn_cpu.inference import linear
from pipeline.semantic_map.networks.dgcnn_cpu.training_edges import ActivatedEdges, Edges, tiles
from pipeline.semantic_map.networks.dgcnn_cpu.training_norm import Largest, Norm, signs


class Linear(Function):
    """``x Wᵀ``."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor) -> Tensor:
        """(N, C) x and (C', C) W to (N, C')."""
        ctx.save_for_backward(x, weight)
        return linear(x, weight)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor]:
        """Gradients of x, where it is wanted, and W."""
        x, weight = ctx.saved_tensors
        to_x = linear(gradients[0], weight.T.contiguous()) if ctx.needs_input_grad[0] else None
        return to_x, gradients[0].T @ x


class LargestLinear(Function):
    """LeakyReLU(norm(W x)), and of that the maximum over the points of each block."""

    @staticmethod
    def forward(
        ctx: Any,
        x: Tensor,
        weight: Tensor,
        gamma: Tensor,
        beta: Tensor,
        sizes: list[int],
        norm: nn.BatchNorm1d,
    ) -> Tensor:
        """(N, C) x, blocks of ``sizes``, and (C', C) W to (B, C'); gamma and beta are those of ``norm``."""
        sign = signs(gamma)
        signed = weight * sign[:, None]
        largest, winners, sums = _empty_largest(len(sizes), len(weight))
        for b, block in enumerate(x.split(sizes)):
            responses = linear(block, signed).numpy()
            kernels.largest_of_groups(responses, largest[b : b + 1], winners[b : b + 1], *sums)
        ctx.largest = Largest(torch.from_numpy(largest), winners, Norm.of(*sums, len(x), sign, norm))
        ctx.sizes, ctx.sign = sizes, sign
        ctx.save_for_backward(x, signed)
        return ctx.largest.activated()

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of x, W, γ and β."""
        x, signed = ctx.saved_tensors
        to_winners, to_gamma, to_beta = ctx.largest.backward(gradients[0])
        constant, factor = ctx.largest.norm.affine(to_gamma, to_beta)
        to_x = _affine_of_input(x, signed, constant, factor)
        to_weight = _affine_of_weight(signed, constant, factor, x.sum(dim=0), x.T @ x)
        for b, (block, to_block) in enumerate(zip(x.split(ctx.sizes), to_x.split(ctx.sizes), strict=True)):
            kernels.backward_through_winners(
                to_winners[b : b + 1].numpy(), ctx.largest.winners[b : b + 1], signed.numpy(),
                block.numpy(), to_block.numpy(), to_weight.numpy(),
            )  # fmt: skip
        return to_x, to_weight * ctx.sign[:, None], to_gamma * ctx.sign, to_beta, None, None


class LargestSum(Function):
    """LeakyReLU(norm(A x_j + B x_i)), and of that the maximum over each point's neighbours j."""

    @staticmethod
    def forward(
        ctx: Any,
        a: Tensor,
        b: Tensor,
        gamma: Tensor,
        beta: Tensor,
        neighbours: NDArray[np.int32],
        norm: nn.BatchNorm1d,
    ) -> Tensor:
        """(N, C) A x_j and B x_i and (N, k) neighbours to (N, C); gamma and beta are those of ``norm``."""
        sign = signs(gamma)
        edges = Edges.of(a * sign, b * sign, neighbours)
        responses, winners, _ = _empty_largest(*a.shape)
        kernels.largest_sums(edges.a.numpy(), edges.b.numpy(), neighbours, responses, winners)
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
    """LeakyReLU(norm(W LeakyReLU(norm(A x_j + B x_i)))), and of that the maximum over each point's neighbours j."""

    @staticmethod
    def forward(
        ctx: Any,
        a: Tensor,
        b: Tensor,
        gamma1: Tensor,
        beta1: Tensor,
        weight: Tensor,
        gamma2: Tensor,
        beta2: Tensor,
        neighbours: NDArray[np.int32],
        norm1: nn.BatchNorm1d,
        norm2: nn.BatchNorm1d,
    ) -> Tensor:
        """(N, C) A x_j and B x_i, (C', C) W, (N, k) neighbours to (N, C'); γ and β are those of the norms."""
        edges = Edges.of(a, b, neighbours)
        activated = edges.activated(edges.norm(torch.ones_like(gamma1), norm1))
        sign = signs(gamma2)
        signed = weight * sign[:, None]
        largest, winners, sums = _empty_largest(len(a), len(weight))
        for rows in tiles(len(a)):
            responses = linear(activated.tile(rows), signed).numpy()
            kernels.largest_of_groups(responses, largest[rows], winners[rows], *sums)
        ctx.largest = Largest(
            torch.from_numpy(largest), winners, Norm.of(*sums, neighbours.size, sign, norm2)
        )
        ctx.edges, ctx.activated, ctx.sign = edges, activated, sign
        ctx.save_for_backward(signed)
        return ctx.largest.activated()

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of A x_j, B x_i, γ1, β1, W, γ2 and β2."""
        (signed,) = ctx.saved_tensors
        edges, activated = cast(Edges, ctx.edges), cast(ActivatedEdges, ctx.activated)
        to_winners, to_gamma, to_beta = ctx.largest.backward(gradients[0])
        constant, factor = ctx.largest.norm.affine(to_gamma, to_beta)
        total, products = torch.zeros(signed.shape[1]), torch.zeros(signed.shape[1], signed.shape[1])
        to_weight, back = torch.zeros_like(signed), activated.backward()
        for rows in tiles(len(to_winners)):
            h = activated.tile(rows)
            to_h = _affine_of_input(h, signed, constant, factor)
            kernels.backward_through_winners(
                to_winners[rows].numpy(), ctx.largest.winners[rows], signed.numpy(), h.numpy(), to_h.numpy(),
                to_weight.numpy(),
            )  # fmt: skip
            back.add(edges, rows, h, to_h)
            total += h.sum(dim=0)
            products += h.T @ h
        to_weight += _affine_of_weight(signed, constant, factor, total, products)
        to_a, to_b, to_gamma1, to_beta1 = back.finish(edges)
        return (
            to_a, to_b, to_gamma1, to_beta1, to_weight * ctx.sign[:, None], to_gamma * ctx.sign, to_beta,
            None, None, None,
        )  # fmt: skip


def _empty_largest(
    groups: int, channels: int
) -> tuple[NDArray[np.float32], NDArray[np.int32], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Room for maxima and winners, and zeros for sums."""
    shape = groups, channels
    return np.empty(shape, np.float32), np.empty(shape, np.int32), (np.zeros(channels), np.zeros(channels))


def _affine_of_input(x: Tensor, weight: Tensor, constant: Tensor, factor: Tensor) -> Tensor:
    """The gradient of x where that of W x is −(constant + factor · W x)."""
    return linear(x, -(weight.T @ (factor[:, None] * weight)), -(constant @ weight))


def _affine_of_weight(
    weight: Tensor, constant: Tensor, factor: Tensor, total: Tensor, products: Tensor
) -> Tensor:
    """The gradient of W where that of W x is −(constant + factor · W x): with the sums of x and of x xᵀ."""
    return -(constant[:, None] * total + factor[:, None] * (weight @ products))
