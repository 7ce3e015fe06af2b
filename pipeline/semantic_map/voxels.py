"""A cloud thinned to one point a voxel: near surfaces get no more points than far ones, and noise averages out."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

_HALF = 1 << 20
"""Voxels from the origin to where keys end, along every axis."""


@dataclass(frozen=True, eq=False)
class VoxelCloud:
    """The mean of the points of every occupied voxel, in the order of the voxels' keys.

    Attributes:
        points: (M, 3) float32.
        voxel_of_point: (N,) int64 index of the voxel of every point that was given; M for those that are not finite
            or too far out for a key.
    """

    points: NDArray[np.float32]
    voxel_of_point: NDArray[np.int64]

    @classmethod
    def of(cls, points: NDArray[np.float32], voxel_size: float) -> "VoxelCloud":
        """Thin (N, 3) float32 points to cubes whose edge is ``voxel_size``."""
        with np.errstate(invalid="ignore"):
            cells = np.floor(points * np.float32(1 / voxel_size))
        valid = (np.abs(cells) < _HALF).all(axis=1)  # NaN fails every comparison
        i, j, k = cells[valid].astype(np.int64).T + _HALF
        keys, voxels = np.unique((i << 21 | j) << 21 | k, return_inverse=True)
        hits = np.bincount(voxels, minlength=len(keys))
        sums = [np.bincount(voxels, axis, len(keys)) for axis in points[valid].T]
        voxel_of_point = np.full(len(points), len(keys))
        voxel_of_point[valid] = voxels
        return cls((np.stack(sums, axis=1) / hits[:, None]).astype(np.float32), voxel_of_point)

    @cached_property
    def hits(self) -> NDArray[np.int64]:
        """(M,) number of points of every voxel."""
        return np.bincount(self.voxel_of_point, minlength=len(self.points) + 1)[:-1]
