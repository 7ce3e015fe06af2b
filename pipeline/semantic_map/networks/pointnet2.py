"""PointNet++ for semantic segmentation, single scale (Qi et al., NeurIPS 2017): PointNets on ever larger balls."""

from collections.abc import Sequence
from typing import TypeVar, cast

import torch
from torch import Tensor, nn
from torch.nn.functional import linear

from pipeline.semantic_map.networks.layers import max_over_edges, mlp
from pipeline.semantic_map.networks.neighbourhoods import (
    PointFeatures,
    ball_query,
    farthest_point_sample,
    interpolated,
)
from pipeline.semantic_map.networks.network import PointNetwork

T = TypeVar("T", int, float)
ABSTRACTIONS = 4
CENTRE_FRACTION = 0.25
"""Fraction of a level's points that become ball centres, which are the next level's points: of 4,096, first 1,024,
then 256, 64 and 16."""
RADIUS = 0.1
"""Radius of the first level's balls, m; it doubles from level to level, and so does the number of features."""
BALL_FEATURES = 32
"""Number of features within a ball of the first level."""
BALL_POINTS = 32
"""Maximum number of points of a ball."""


def doubled(first: T) -> list[T]:
    """The values for all levels and one more, each twice the previous one."""
    return [first * 2**level for level in range(ABSTRACTIONS + 1)]


class SetAbstraction(nn.Module):
    """A PointNet on the ball around each of a few centres."""

    def __init__(self, channels: int, widths: Sequence[int], radius: float) -> None:
        """``widths``: numbers of outputs of the layers; ``radius``: radius of the balls, m."""
        super().__init__()
        self.radius = radius
        self.layers = mlp(3 + channels, *widths)

    def forward(self, cloud: PointFeatures) -> PointFeatures:
        """The centres, with the features of their balls."""
        centres, edges = balls(cloud, self.radius, cast(nn.Linear, self.layers[0]))
        return PointFeatures(centres.positions, max_over_edges(edges, self.layers[1:]), centres.sizes)


def balls(cloud: PointFeatures, radius: float, layer: nn.Linear, unit: float = 1.0) -> tuple[PointFeatures, Tensor]:
    """Centres of balls of ``radius`` m, and (Q, K, C) outputs of ``layer`` for their edges.

    The input of an edge is [(x_j − x_i) / ``unit``, features_j].

    The layer is linear, so it is applied to points and centres, which are fewer than the edges.
    """
    index, sizes = farthest_point_sample(cloud, CENTRE_FRACTION)
    centres = PointFeatures(cloud.positions[index], cloud.features[index], sizes)
    near = ball_query(cloud, centres, radius, BALL_POINTS)
    of_points = layer(torch.cat((cloud.positions / unit, cloud.features), dim=1))
    of_centres = linear(centres.positions / unit, layer.weight[:, :3])
    return centres, of_points[near] - of_centres[:, None]


class FeaturePropagation(nn.Module):
    """Features of a coarse cloud, interpolated at the points of a fine cloud and joined with the fine features."""

    def __init__(self, channels: int, widths: Sequence[int]) -> None:
        """``channels``: features of both clouds together; ``widths``: numbers of outputs of the layers."""
        super().__init__()
        self.layers = mlp(channels, *widths)

    def forward(self, coarse: PointFeatures, fine: PointFeatures) -> PointFeatures:
        """The fine cloud with new features."""
        features = torch.cat((interpolated(coarse, fine), fine.features), dim=1)
        return PointFeatures(fine.positions, self.layers(features), fine.sizes)


class PointNet2(PointNetwork):
    """Four set abstractions, and four feature propagations back to all points."""

    NAME = "pointnet2"

    def __init__(self, channels: int, classes: int) -> None:
        """Start with random weights; the first three channels are x, y, z in m."""
        super().__init__(channels, classes)
        inner = doubled(BALL_FEATURES)[:-1]
        outputs = [2 * width for width in inner]
        widths = [(width, width, 2 * width) for width in inner]
        self.down = nn.ModuleList(map(SetAbstraction, (channels, *outputs), widths, doubled(RADIUS)))
        wide, narrow = outputs[2], outputs[1]
        coarse = outputs[-1], wide, wide, narrow
        fine = *reversed(outputs[:-1]), 0  # as in the published code, the last level uses no features of the points
        back = (wide, wide), (wide, wide), (wide, narrow), (narrow, narrow, narrow)
        self.up = nn.ModuleList(FeaturePropagation(a + b, w) for a, b, w in zip(coarse, fine, back, strict=True))
        self.head = mlp(narrow, narrow)
        self.dropout = nn.Dropout()
        self.classifier = nn.Linear(narrow, classes)

    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, classes) logits of (P, channels) float32 points, in blocks of ``sizes`` points."""
        clouds = [PointFeatures(points[:, :3], points, sizes)]
        for down in self.down:
            clouds.append(down(clouds[-1]))
        clouds[0] = PointFeatures(points[:, :3], points[:, :0], sizes)
        x = clouds.pop()
        for up in self.up:
            x = up(x, clouds.pop())
        return self.classifier(self.dropout(self.head(x.features)))
