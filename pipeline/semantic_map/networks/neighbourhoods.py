"""Neighbourhoods of points: farthest point sampling, ball query, k nearest neighbours and interpolation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor

from pipeline.semantic_map.networks.neighbourhood_kernels import farthest_points


@dataclass(frozen=True, eq=False)
class PointFeatures:
    """The concatenated points of several blocks, with their features.

    Attributes:
        positions: (P, 3) float32, m.
        features: (P, C) float32.
        sizes: number of points of every block.
    """

    positions: Tensor
    features: Tensor
    sizes: Sequence[int]


def farthest_point_sample(cloud: PointFeatures, fraction: float) -> tuple[Tensor, list[int]]:
    """(Q,) int64 indices of a ``fraction`` of each block by farthest point sampling, and their number per block."""
    counts = [max(1, ceil(size * fraction)) for size in cloud.sizes]

    def choose(points: NDArray[np.float32], block: int) -> NDArray[np.int64]:
        chosen = np.empty(counts[block], np.int64)
        farthest_points(points, chosen)
        return chosen

    return _by_block(cloud, choose), counts


def ball_query(cloud: PointFeatures, centres: PointFeatures, radius: float, k: int) -> Tensor:
    """(Q, k) int64 indices of points of the same block within ``radius``, m, of every centre (ball query).

    Of more than k points, the k nearest are taken. Fewer points are repeated, as in the code of PointNet++'s authors;
    repeats do not change a maximum over the points. Centres must be points of the cloud.
    """
    return _query(cloud, centres, lambda tree, points: _nearest(tree, points, k, radius))


def nearest(cloud: PointFeatures, centres: PointFeatures, k: int) -> Tensor:
    """(Q, k) int64 indices of the k points of the same block that are nearest to every centre, the nearest first.

    If a block has fewer than k points, its points are repeated in the same order.
    """
    return _query(cloud, centres, lambda tree, points: _nearest(tree, points, k))


def interpolated(cloud: PointFeatures, places: PointFeatures) -> Tensor:
    """(Q, C) features at ``places``: the mean over the three nearest points, weighted by inverse squared distance.

    PointNet++, equation 2, with p = 2 and k = 3.
    """
    near = nearest(cloud, places, 3)
    weight = 1 / ((cloud.positions[near] - places.positions[:, None]).square().sum(dim=-1) + 1e-8)
    # In a block of two points, the nearer point is used twice.
    weight = weight / weight.sum(dim=1, keepdim=True)
    return (cloud.features[near] * weight[..., None]).sum(dim=1)


def _nearest(tree: cKDTree, points: NDArray[np.float32], k: int, radius: float = np.inf) -> NDArray[np.int64]:
    found = min(k, tree.n)
    index = np.asarray(tree.query(points, k=range(1, found + 1), distance_upper_bound=radius)[1])
    index = np.where(index < tree.n, index, index[:, :1])
    return index[:, np.arange(k) % found]


def _query(
    cloud: PointFeatures, centres: PointFeatures, find: Callable[[cKDTree, NDArray[np.float32]], NDArray[np.int64]]
) -> Tensor:
    of_block = [points.cpu().numpy() for points in centres.positions.detach().split(list(centres.sizes))]
    return _by_block(cloud, lambda points, block: find(cKDTree(points), of_block[block]))


def _by_block(cloud: PointFeatures, choose: Callable[[NDArray[np.float32], int], NDArray[np.int64]]) -> Tensor:
    """Indices of rows of the cloud, chosen block by block."""
    rows, start = [], 0
    for block, size in enumerate(cloud.sizes):
        points = cloud.positions.detach()[start : start + size].cpu().numpy()
        rows.append(choose(points, block) + start)
        start += size
    return torch.from_numpy(np.concatenate(rows)).to(cloud.positions.device)
