"""Batch norm over responses that are not stored: it needs their sums forward and their maxima backward."""

from dataclasses import dataclass
from typing import Self, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from pipeline.semantic_map.networks.dgcnn import SLOPE

Sums = tuple[NDArray[np.float64], NDArray[np.float64]]
"""(C,) and (C,): sums over the responses, and over their squares."""


@dataclass(frozen=True, eq=False)
class Norm:
    """Batch norm over the responses of a batch: γ/σ · (r − μ) + β.

    Attributes:
        mean, sigma, gamma, beta: (C,) float32, μ, σ, γ and β.
        count: number of responses.
    """

    mean: Tensor
    sigma: Tensor
    gamma: Tensor
    beta: Tensor
    count: int

    @classmethod
    def of(cls, sums: Sums, count: int, sign: Tensor, norm: nn.BatchNorm1d) -> Self:
        """From the sums of the responses times ``sign``; updates the layer's running mean and variance."""
        average, average_square = sums[0] / count, sums[1] / count
        mean = torch.from_numpy(average).float()
        variance = torch.from_numpy(np.maximum(average_square - average**2, 0)).float()
        momentum = cast(float, norm.momentum)
        cast(Tensor, norm.running_mean).lerp_(mean * sign, momentum)
        cast(Tensor, norm.running_var).lerp_(variance * (count / max(count - 1, 1)), momentum)
        sigma = (variance + norm.eps).sqrt()
        return cls(mean, sigma, norm.weight.detach() * sign, norm.bias.detach(), count)

    @property
    def scale(self) -> Tensor:
        """(C,) γ/σ."""
        return self.gamma / self.sigma

    @property
    def shift(self) -> Tensor:
        """(C,) β − μ γ/σ."""
        return self.beta - self.mean * self.scale

    def affine(self, to_gamma: Tensor, to_beta: Tensor) -> tuple[Tensor, Tensor]:
        """(C,) p and (C,) q of p + q r, which batch norm subtracts from the gradient of a response r."""
        factor = self.scale * to_gamma / (self.sigma * self.count)
        return self.scale * to_beta / self.count - factor * self.mean, factor


@dataclass(frozen=True, eq=False)
class Largest:
    """The maximum response of each group, and the batch norm that follows.

    Attributes:
        responses: (R, C) float32, before batch norm.
        winners: (R, C) int32, the maximum's place in its group.
        norm: with γ ≥ 0, so that the maximum stays the maximum.
    """

    responses: Tensor
    winners: NDArray[np.int32]
    norm: Norm

    def activated(self) -> Tensor:
        """(R, C) after batch norm and LeakyReLU."""
        return leaky_relu(self.responses * self.norm.scale + self.norm.shift, SLOPE)

    def backward(self, gradient: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Given the gradient of ``activated``: of the winners' responses (without the affine part), of γ and of β."""
        norm = self.norm
        normalized = (self.responses - norm.mean) / norm.sigma
        step = torch.where(normalized * norm.gamma + norm.beta > 0, gradient, SLOPE * gradient)
        return step * norm.scale, (step * normalized).sum(dim=0), step.sum(dim=0)


def signs(gamma: Tensor) -> Tensor:
    """−1 where batch norm reverses the order of responses, else 1."""
    return torch.where(gamma < 0, -1.0, 1.0)
