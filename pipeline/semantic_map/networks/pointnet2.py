"""PointNet++ for semantic segmentation, single scale (Qi et al., NeurIPS 2017): PointNets on ever larger balls."""

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn.functional import linear

from pipeline.semantic_map.networks.layers import largest, mlp
from pipeline.semantic_map.networks.neighbourhoods import Cloud, farthest, in_ball, interpolated
from pipeline.semantic_map.networks.network import RowNetwork

SHARE = 0.25
"""Share of a cloud's points that become centres of balls, the points of the next level: 4,096, 1,024, 256, 64, 16."""
RADII = (0.1, 0.2, 0.4, 0.8)
"""m, of the balls of each level."""
NEIGHBOURS = 32
"""Most points of a ball."""


class SetAbstraction(nn.Module):
    """A PointNet on the ball around each of a few centres."""

    def __init__(self, channels: int, widths: Sequence[int], radius: float) -> None:
        """``widths`` are those of its layers; ``radius`` in m."""
        super().__init__()
        self.radius = radius
        self.layers = mlp(3 + channels, *widths)

    def forward(self, cloud: Cloud) -> Cloud:
        """The centres, with the features of their balls."""
        centres, edges = balls(cloud, self.radius, cast(nn.Linear, self.layers[0]))
        return Cloud(centres.positions, largest(edges, self.layers[1:]), centres.sizes)


def balls(cloud: Cloud, radius: float, layer: nn.Linear, unit: float = 1.0) -> tuple[Cloud, Tensor]:
    """Centres of balls of ``radius``, m, and (Q, K, C) ``layer`` of the edges [(x_j − x_i) / ``unit``, features_j].

    The layer is linear, so it is applied to points and centres, which are fewer than the edges.
    """
    index, sizes = farthest(cloud, SHARE)
    centres = Cloud(cloud.positions[index], cloud.features[index], sizes)
    near = in_ball(cloud, centres, radius, NEIGHBOURS)
    of_points = layer(torch.cat((cloud.positions / unit, cloud.features), dim=1))
    of_centres = linear(centres.positions / unit, layer.weight[:, :3])
    return centres, of_points[near] - of_centres[:, None]


class FeaturePropagation(nn.Module):
    """Features of a coarse cloud, interpolated at the points of a finer one and joined with its own features."""

    def __init__(self, channels: int, widths: Sequence[int]) -> None:
        """``channels`` is the number of both clouds together; ``widths`` are those of the layers."""
        super().__init__()
        self.layers = mlp(channels, *widths)

    def forward(self, coarse: Cloud, fine: Cloud) -> Cloud:
        """The fine cloud with new features."""
        features = torch.cat((interpolated(coarse, fine), fine.features), dim=1)
        return Cloud(fine.positions, self.layers(features), fine.sizes)


class PointNet2(RowNetwork):
    """Four set abstractions, and four feature propagations back to all points."""

    NAME = "pointnet2"

    def __init__(self, channels: int = 6, classes: int = 6) -> None:
        """Random weights; the first three channels are x, y, z in m."""
        super().__init__(channels, classes)
        widths = ((32, 32, 64), (64, 64, 128), (128, 128, 256), (256, 256, 512))
        inputs = (channels, *(w[-1] for w in widths))
        self.down = nn.ModuleList(map(SetAbstraction, inputs, widths, RADII))
        # As in the published code, the last one uses no features of the points themselves.
        self.up = nn.ModuleList(
            map(
                FeaturePropagation,
                (512 + 256, 256 + 128, 256 + 64, 128),
                ((256,) * 2, (256,) * 2, (256, 128), (128,) * 3),
            )
        )
        self.head = mlp(128, 128)
        self.dropout = nn.Dropout(0.5)
        self.classifier = nn.Linear(128, classes)

    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, channels) float32 points of blocks of ``sizes`` to (P, classes) logits."""
        clouds = [Cloud(points[:, :3], points, sizes)]
        for down in self.down:
            clouds.append(down(clouds[-1]))
        clouds[0] = Cloud(points[:, :3], points[:, :0], sizes)
        x = clouds.pop()
        for up in self.up:
            x = up(x, clouds.pop())
        return self.classifier(self.dropout(self.head(x.features)))
