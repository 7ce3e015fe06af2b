"""PointCNN for semantic segmentation (Li et al., NeurIPS 2018): convolutions on neighbours in a learned order.

Levels, neighbours and dilations are taken from the authors' settings for part segmentation on ShapeNet, because the
settings for S3DIS look up one level's neighbours in another. The width is taken from the settings for Semantic3D, and
is half the width for ShapeNet. The authors' levels have 768, 384 and 128 of 2,048 points; here, a level has a
fraction of its block's points, because their number varies.
"""

from collections.abc import Sequence
from math import ceil

import torch
from torch import Tensor, nn

from pipeline.semantic_map.networks.neighbourhoods import PointFeatures, farthest_point_sample, nearest
from pipeline.semantic_map.networks.network import PointNetwork

LEVEL_FEATURES = 128
"""Number of features of a point in the first two levels: 32 times the "x" of the authors' settings. It doubles with
each further level."""
ENCODER = ((8, 1, 1, 1), (12, 2, 3 / 8, 1), (16, 2, 1 / 2, 2), (16, 6, 1 / 3, 4))
"""For each level: K neighbours, dilation D (every D-th of the nearest), fraction of the previous level's points, and
number of features divided by LEVEL_FEATURES."""
DECODER = ((16, 6, 3, 2), (12, 6, 2, 1), (8, 6, 1, 0), (8, 4, 0, 0))
"""For each step: K, D, and the levels from which and to which features are passed."""
LIFTED = 4
"""Ratio of the number of features to the number of features computed from coordinates; also the depth multiplier of
the first level."""


def dense(inputs: int, outputs: int) -> nn.Sequential:
    """Linear map, ELU and batch norm, in the authors' order."""
    return nn.Sequential(nn.Linear(inputs, outputs, bias=False), nn.ELU(), nn.BatchNorm1d(outputs))


class Depthwise(nn.Module):
    """Depthwise convolution over the K neighbours: a separate linear map for each channel."""

    def __init__(self, k: int, channels: int, depth: int) -> None:
        """``depth``: number of features computed from each channel."""
        super().__init__()
        self.weight = nn.Parameter(torch.empty(channels, k, depth))
        nn.init.normal_(self.weight, std=(1 / k) ** 0.5)

    def forward(self, x: Tensor) -> Tensor:
        """(P, C · depth) features of points whose neighbours have (P, K, C) features."""
        return torch.einsum("pkc,ckd->pcd", x, self.weight).flatten(start_dim=1)

    def of_products(self, matrix: Tensor, *parts: Tensor) -> Tensor:
        """(P, C · depth): ``forward`` of ``matrix`` (P, K, K) times ``parts``, each (P, K, some of the C channels).

        The matrix is multiplied by the weights, not by the features, so that no product as large as the features is
        stored for the backward pass.
        """
        of_parts, turned = [], matrix.transpose(1, 2)
        for part, weight in zip(parts, self.weight.split([part.shape[2] for part in parts]), strict=True):
            by_depth = [((turned @ w.T) * part).sum(dim=1) for w in weight.unbind(dim=2)]
            of_parts.append(torch.stack(by_depth, dim=2).flatten(start_dim=1))
        return torch.cat(of_parts, dim=1)


class XConv(nn.Module):
    """X-Conv, algorithm 1 of the paper."""

    def __init__(self, k: int, dilation: int, channels: int, lifted: int, outputs: int, depth: int) -> None:
        """Create the layers.

        Args:
            k, dilation: number of neighbours, and step with which they are chosen from the nearest points.
            channels: number of features of a neighbour, 0 if it has none.
            lifted: number of features computed from a neighbour's coordinates.
            outputs: number of features of the result.
            depth: depth multiplier of the depthwise convolution.
        """
        super().__init__()
        self.k, self.dilation, self.has_features = k, dilation, channels > 0
        self.lift = nn.Sequential(dense(3, lifted), dense(lifted, lifted))
        self.x0 = dense(3 * k, k * k)
        self.x1 = nn.Sequential(Depthwise(k, k, k), nn.ELU(), nn.BatchNorm1d(k * k))
        self.x2 = nn.Sequential(Depthwise(k, k, k), nn.BatchNorm1d(k * k))
        self.depthwise, self.pointwise = (
            Depthwise(k, lifted + channels, depth),
            dense((lifted + channels) * depth, outputs),
        )

    def forward(self, cloud: PointFeatures, centres: PointFeatures) -> Tensor:
        """(Q, outputs) features of the centres."""
        near = nearest(cloud, centres, self.k * self.dilation)[:, :: self.dilation]
        offsets = cloud.positions[near] - centres.positions[:, None]
        count = len(near)
        parts = [self.lift(offsets.flatten(end_dim=1)).view(count, self.k, -1)]
        if self.has_features:
            parts.append(cloud.features[near])
        matrix = self.x0(offsets.flatten(start_dim=1)).view(count, self.k, self.k)
        matrix = self.x1(matrix).view(count, self.k, self.k)
        matrix = self.x2(matrix).view(count, self.k, self.k)
        return self.pointwise(self.depthwise.of_products(matrix, *parts))


class PointCnn(PointNetwork):
    """Four X-Convs down to coarser levels, the last joined with features of the coordinates, and four back up."""

    NAME = "pointcnn"

    def __init__(self, channels: int, classes: int) -> None:
        """Start with random weights; the first three channels are x, y, z in m, and the others are features."""
        super().__init__(channels, classes)
        widths = [LEVEL_FEATURES * level[-1] for level in ENCODER]
        lifted = [width // LIFTED for width in widths]
        inputs = [LEVEL_FEATURES // 2, *widths]
        self.features = dense(channels - 3, inputs[0])
        self.down = nn.ModuleList(
            XConv(k, d, c, few, out, LIFTED if c < LEVEL_FEATURES else ceil(out / c))
            for (k, d, _, _), c, few, out in zip(ENCODER, inputs, [lifted[0], *lifted], widths, strict=False)
        )
        self.where = nn.Sequential(dense(3, lifted[-1]), dense(lifted[-1], lifted[-1]))
        own = [*widths[:-1], widths[-1] + lifted[-1]]
        from_below = [own[-1], *(widths[to] for _, _, _, to in DECODER)]
        self.up = nn.ModuleList(
            XConv(k, d, c, lifted[level], widths[to], 1)
            for (k, d, level, to), c in zip(DECODER, from_below, strict=False)
        )
        self.fuse = nn.ModuleList(dense(widths[to] + own[to], widths[to]) for _, _, _, to in DECODER)
        self.head = nn.Sequential(dense(LEVEL_FEATURES, LEVEL_FEATURES), dense(LEVEL_FEATURES, LEVEL_FEATURES))
        self.dropout = nn.Dropout()
        self.classifier = nn.Linear(LEVEL_FEATURES, classes)

    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, classes) logits of (P, channels) float32 points, in blocks of ``sizes`` points."""
        levels = self._levels(PointFeatures(points[:, :3], self.features(points[:, 3:]), sizes))
        x = levels[-1]
        for (_, _, _, to), convolution, fuse in zip(DECODER, self.up, self.fuse, strict=True):
            fine = levels[to]
            features = fuse(torch.cat((convolution(x, fine), fine.features), dim=1))
            x = PointFeatures(fine.positions, features, fine.sizes)
        return self.classifier(self.dropout(self.head(x.features)))

    def _levels(self, cloud: PointFeatures) -> list[PointFeatures]:
        levels: list[PointFeatures] = []
        for (_, _, share, _), convolution in zip(ENCODER, self.down, strict=True):
            positions, sizes = cloud.positions, cloud.sizes
            if share < 1:
                index, sizes = farthest_point_sample(cloud, share)
                positions = positions[index]
            features = convolution(cloud, PointFeatures(positions, positions[:, :0], sizes))
            if len(levels) == len(ENCODER) - 1:
                features = torch.cat((self.where(positions), features), dim=1)
            cloud = PointFeatures(positions, features, sizes)
            levels.append(cloud)
        return levels
