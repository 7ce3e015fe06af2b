"""PointNeXt-S for semantic segmentation (Qian et al., NeurIPS 2022): PointNet++, modernised.

Differences from PointNet++:

- A linear stem lifts the features.
- Offsets are divided by the radius, which gives them the scale of features.
- Each level adds its centres' own features (a residual connection).
- The decoder is symmetric.

The variant S has no inverted residual blocks.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import cast

from torch import Tensor, nn
from torch.nn.functional import relu

from pipeline.semantic_map.networks.layers import max_over_edges, mlp
from pipeline.semantic_map.networks.neighbourhoods import PointFeatures
from pipeline.semantic_map.networks.network import PointNetwork
from pipeline.semantic_map.networks.pointnet2 import BALL_FEATURES, RADIUS, FeaturePropagation, balls, doubled

WIDTHS = doubled(BALL_FEATURES)
"""Number of features of a point at each level."""


class ResidualSetAbstraction(nn.Module):
    """Two layers on the balls around a few centres, added to the centres' own features."""

    def __init__(self, channels: int, outputs: int, radius: float) -> None:
        """Map ``channels`` to ``outputs`` features of a point; ``radius``: radius of the balls, m."""
        super().__init__()
        self.radius = radius
        last = nn.Linear(outputs // 2, outputs, bias=False), nn.BatchNorm1d(outputs)
        self.layers = nn.Sequential(*mlp(3 + channels, outputs // 2), *last)
        self.own = nn.Linear(channels, outputs)

    def forward(self, cloud: PointFeatures) -> PointFeatures:
        """The centres, with the features of their balls."""
        centres, edges = balls(cloud, self.radius, cast(nn.Linear, self.layers[0]), self.radius)
        features = relu(max_over_edges(edges, self.layers[1:]) + self.own(centres.features))
        return PointFeatures(centres.positions, features, centres.sizes)


class PointNeXt(PointNetwork):
    """The variant S: a linear stem, four set abstractions and four feature propagations."""

    NAME = "pointnext"

    def __init__(self, channels: int, classes: int) -> None:
        """Start with random weights; the first three channels are x, y, z in m."""
        super().__init__(channels, classes)
        self.stem = nn.Linear(channels, WIDTHS[0])
        self.down = nn.ModuleList(
            ResidualSetAbstraction(fine, coarse, radius)
            for (fine, coarse), radius in zip(pairwise(WIDTHS), doubled(RADIUS), strict=False)
        )
        self.up = nn.ModuleList(
            FeaturePropagation(fine + coarse, (fine, fine)) for coarse, fine in pairwise(reversed(WIDTHS))
        )
        self.head = mlp(WIDTHS[0], WIDTHS[0])
        self.dropout = nn.Dropout()
        self.classifier = nn.Linear(WIDTHS[0], classes)

    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, classes) logits of (P, channels) float32 points, in blocks of ``sizes`` points."""
        clouds = [PointFeatures(points[:, :3], self.stem(points), sizes)]
        for down in self.down:
            clouds.append(down(clouds[-1]))
        x = clouds.pop()
        for up in self.up:
            x = up(x, clouds.pop())
        return self.classifier(self.dropout(self.head(x.features)))
