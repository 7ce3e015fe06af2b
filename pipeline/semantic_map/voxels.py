"""A cloud thinned to one point per voxel: near surfaces get as many points as far ones, and noise averages out."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.geometry.cells_kernels import cells_of


@dataclass(frozen=True, eq=False)
class VoxelCloud:
    """The mean of the points of every occupied voxel, in the order of the voxels' keys.

    Attributes:
        points: (M, 3) float32.
        hits: (M,) uint32 number of points in every voxel.
        voxel_of_point: (N,) int64 index of the voxel of every point that was given; M for points that are not finite
            or too far from the origin for a key.
    """

    points: NDArray[np.float32]
    hits: NDArray[np.uint32]
    voxel_of_point: NDArray[np.int64]

    @classmethod
    def of(cls, points: NDArray[np.float32], voxel_size: float | tuple[float, float, float]) -> Self:
        """Thin (N, 3) float32 points to cubes, or to boxes along x, y and z, with edges of ``voxel_size`` m."""
        if isinstance(voxel_size, tuple):
            found, keys = cells_of(points / np.array(voxel_size, np.float32), np.float32(1))
        else:
            found, keys = cells_of(points, np.float32(1 / voxel_size))
        # Points without a voxel get the last rank.
        rank = np.append(np.empty(len(keys), np.int64), len(keys))
        rank[keys.argsort()] = np.arange(len(keys))
        voxel_of_point = rank[found]
        hits = np.bincount(voxel_of_point, minlength=len(keys))[: len(keys)].astype(np.uint32)
        cloud = cls(points, hits, voxel_of_point)
        return replace(cloud, points=cloud.means(points))

    def means(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """(M, C) float32 mean over the points of every voxel, given the (N, C) values of all points."""
        sums = [np.bincount(self.voxel_of_point, of, len(self.hits))[: len(self.hits)] for of in values.T]
        return (np.stack(sums, axis=1) / self.hits[:, None]).astype(np.float32)
