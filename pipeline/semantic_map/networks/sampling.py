"""Random training blocks. Each block depends only on the seed and its number, so training can resume at any step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from torch import Tensor

from pipeline.semantic_map.networks.blocks import BlockConfig, channels
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.training_config import BlockAugmentation, TrainingConfig


@dataclass(frozen=True, eq=False)
class Batch:
    """Concatenated blocks.

    Attributes:
        points: (P, 6 or 9) float32 channels of every point.
        class_fractions: (P, 6) float32 fraction of every class in a point's voxel.
        sizes: number of points of every block.
    """

    points: Tensor
    class_fractions: Tensor
    sizes: list[int]


class BlockSampler:
    """Draws batches from clouds."""

    def __init__(
        self, clouds: Sequence[LabelledCloud], blocks: BlockConfig, min_points: int, config: TrainingConfig
    ) -> None:
        """The blocks of a batch come from the clouds in turn; each has at least ``min_points`` points."""
        self._clouds, self._blocks, self._min_points = clouds, blocks, min_points
        self._size, self._seed, self._augmentation = config.batch, config.seed, config.augmentation

    def batch(self, number: int) -> Batch:
        """The batch with a number; every cloud is used once before any cloud is used again."""
        first = number * self._size
        drawn = [self._block(turn) for turn in range(first, first + self._size)]
        counts = np.concatenate([counts for _, counts in drawn]).astype(np.float32)
        shares = counts / counts.sum(axis=1, keepdims=True)
        points = np.concatenate([points for points, _ in drawn])
        return Batch(torch.from_numpy(points), torch.from_numpy(shares), [len(points) for points, _ in drawn])

    def _block(self, turn: int) -> tuple[NDArray[np.float32], NDArray[np.uint16]]:
        """(n, 6 or 9) channels and (n, 6) counts of the points of a block."""
        epoch, place = divmod(turn, len(self._clouds))
        order = np.random.default_rng([self._seed, epoch]).permutation(len(self._clouds))
        cloud = self._clouds[order[place]]
        rng = np.random.default_rng([self._seed, epoch, place])
        points, camera = augmented(cloud, self._augmentation, rng)
        index, centre = self._crop(cloud, points, rng)
        return channels(points[index], centre, camera, self._blocks), cloud.counts[index]

    def _crop(
        self, cloud: LabelledCloud, points: NDArray[np.float32], rng: np.random.Generator
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Indices of the points of a column around a random point, and the column's centre (2,)."""
        candidates = np.arange(len(points))
        if rng.random() < self._augmentation.rare:
            classes = cloud.classes
            candidates = np.flatnonzero(classes == rng.choice(np.unique(classes)))
        centre = points[rng.choice(candidates), :2] + rng.uniform(-0.5, 0.5, 2) * self._blocks.size
        index = np.flatnonzero((np.abs(points[:, :2] - centre) <= self._blocks.size / 2).all(axis=1))
        share = rng.uniform(self._augmentation.thinnest, 1)
        most = min(max(round(share * len(index)), 1), self._blocks.points)
        index = rng.permutation(index)[:most]
        return np.append(index, rng.choice(index, max(self._min_points - most, 0))), centre


def augmented(
    cloud: LabelledCloud, config: BlockAugmentation, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """The points of the cloud, randomly rotated, mirrored, jittered and darkened, and the (3,) camera position, m."""
    yaw, roll, pitch = rng.uniform(0, 2 * np.pi), *rng.normal(0, config.jitter, 2)
    turn = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    turn[:, 1] *= rng.choice([-1, 1])
    camera = cloud.camera * [0, 0, 1] + [0, 0, rng.normal(0, config.jitter)]
    xyz, colours = np.split(cloud.points, [3], axis=1)
    points = (xyz - cloud.camera) @ turn.T + camera
    points += rng.normal(0, config.jitter, points.shape)
    light = rng.uniform() * (rng.random() >= config.dark)
    return np.concatenate([points, colours * light], axis=1).astype(np.float32), camera
