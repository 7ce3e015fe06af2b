"""A cloud thinned to one point a voxel: near surfaces get no more points than far ones, and noise averages out."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.segments.cells import HALF, keys


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
    def of(cls, points: NDArray[np.float32], voxel_size: float) -> Self:
        """Thin (N, 3) float32 points to cubes whose edge is ``voxel_size`` m."""
        with np.errstate(invalid="ignore"):
            cells = np.floor(points * np.float32(1 / voxel_size))
        valid = (np.abs(cells) < HALF).all(axis=1)  # NaN fails every comparison
        occupied, voxels = np.unique(keys(cells[valid]), return_inverse=True)
        hits = np.bincount(voxels, minlength=len(occupied))
        sums = [np.bincount(voxels, axis, len(occupied)) for axis in points[valid].T]
        voxel_of_point = np.full(len(points), len(occupied))
        voxel_of_point[valid] = voxels
        return cls((np.stack(sums, axis=1) / hits[:, None]).astype(np.float32), voxel_of_point)
