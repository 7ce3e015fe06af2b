"""PointNet for segmentation (Qi et al., CVPR 2017, figure 2): features of each point alone, and a global feature."""

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn

from pipeline.semantic_map.networks.layers import linear_of_points_and_blocks, max_over_blocks, mlp
from pipeline.semantic_map.networks.network import PointNetwork

PENALTY = 1e-3
"""Weight of the regularisation that keeps the feature transform nearly orthogonal (section 3.3 of the paper)."""
LOCAL, GLOBAL = 64, 1024
"""Number of features of a point alone, and of a block."""


class TransformNet(nn.Module):
    """T-Net: one matrix for all points of a block, the identity before training."""

    def __init__(self, channels: int, size: int) -> None:
        """Map ``channels`` features of each point to a ``size`` × ``size`` matrix."""
        super().__init__()
        self.size = size
        last = GLOBAL // 4
        self.points = mlp(channels, LOCAL, 2 * LOCAL, GLOBAL)
        self.block = mlp(GLOBAL, 2 * last, last)
        self.matrix = nn.Linear(last, size * size)
        nn.init.zeros_(self.matrix.weight)
        nn.init.eye_(self.matrix.bias.data.view(size, size))

    def forward(self, features: Tensor, sizes: Sequence[int]) -> Tensor:
        """(B, size, size) matrices, one for the (P, C) features of each block."""
        x = self.block(max_over_blocks(self.points(features), sizes))
        return self.matrix(x).view(-1, self.size, self.size)


class PointNet(PointNetwork):
    """The segmentation network, with both transforms."""

    NAME = "pointnet"

    def __init__(self, channels: int, classes: int) -> None:
        """Start with random weights; the first transform is applied to the first three channels, x, y and z."""
        super().__init__(channels, classes)
        self.turn = TransformNet(channels, 3)
        self.points1 = mlp(channels, LOCAL, LOCAL)
        self.transform = TransformNet(LOCAL, LOCAL)
        last = 2 * LOCAL
        self.points2 = mlp(LOCAL, LOCAL, last, GLOBAL)
        self.head = mlp(GLOBAL + LOCAL, GLOBAL // 2, GLOBAL // 4, last, last)
        self.dropout = nn.Dropout()
        self.classifier = nn.Linear(last, classes)

    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, classes) logits of (P, channels) float32 points, in blocks of ``sizes`` points."""
        turned = _times(points[:, :3], self.turn(points, sizes), sizes)
        local = self.points1(torch.cat((turned, points[:, 3:]), dim=1))
        matrix = self.transform(local, sizes)
        self.penalty = PENALTY * _distance_from_orthogonal(matrix)
        local = _times(local, matrix, sizes)
        everything = max_over_blocks(self.points2(local), sizes)
        x = self.head[1:](linear_of_points_and_blocks(cast(nn.Linear, self.head[0]), local, everything, sizes))
        return self.classifier(self.dropout(x))


def _times(features: Tensor, matrices: Tensor, sizes: Sequence[int]) -> Tensor:
    """(P, C) features, each multiplied by the matrix of its block from ``matrices`` (B, C, C)."""
    blocks = zip(features.split(list(sizes)), matrices, strict=True)
    return torch.cat([block @ matrix for block, matrix in blocks])


def _distance_from_orthogonal(matrices: Tensor) -> Tensor:
    """Mean over (B, C, C) matrices A of ‖I − A Aᵀ‖² (the paper's equation 2)."""
    identity = torch.eye(matrices.shape[1], device=matrices.device)
    return (identity - matrices @ matrices.transpose(1, 2)).square().sum(dim=(1, 2)).mean()
