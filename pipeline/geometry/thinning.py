"""Point clouds thinned to voxels: near surfaces become as sparse as far ones, and noise averages out."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import small_gicp
from numpy.typing import NDArray

from pipeline.arrays import Indices, Places, Points
from pipeline.geometry.voxel_hash import first_points, voxels_of


def first_in_voxels(points: NDArray[np.floating], per_unit: float | np.floating = 1.0) -> Indices:
    """(M,) index of the first of the points (N, 3) in each voxel, ascending; arguments as in :func:`voxels_of`."""
    voxel_of_point, keys = voxels_of(points, per_unit)
    return np.sort(first_points(voxel_of_point, len(keys)))


def voxel_means(points: Places | Points, size: float) -> Places:
    """(M, 3) the mean of the points (N, 3) in each voxel of ``size`` m, in double precision.

    Points are thinned by small_gicp, which also registers the resulting clouds. A :class:`VoxelCloud`, in contrast,
    has single precision and stores the voxel of each point.
    """
    if not len(points):
        return np.zeros((0, 3))
    return np.ascontiguousarray(small_gicp.voxelgrid_sampling(points.astype(np.float64), size).points()[:, :3])


@dataclass(frozen=True, eq=False)
class VoxelCloud:
    """The mean of the points in each occupied voxel, in the order of the voxels' keys.

    Attributes:
        points: (M, 3) mean of the points in each voxel.
        hits: (M,) uint32 number of points in each voxel.
        voxel_of_point: (N,) index of the voxel of each original point; M for points that are not finite or too far
            from the origin for a key.
    """

    points: Points
    hits: NDArray[np.uint32]
    voxel_of_point: Indices

    @classmethod
    def of(cls, points: Points, voxel_size: float | tuple[float, float, float]) -> Self:
        """Thin points to voxels with edges of ``voxel_size`` m: cubes, or boxes with these edges along x, y and z."""
        if isinstance(voxel_size, tuple):
            in_voxels = np.divide(points, np.array(voxel_size, np.float32), dtype=np.float32)
            voxel_of_point, keys = voxels_of(in_voxels)
        else:
            voxel_of_point, keys = voxels_of(points, 1 / voxel_size)
        hits = np.bincount(voxel_of_point, minlength=len(keys))[: len(keys)].astype(np.uint32)
        cloud = cls(points, hits, voxel_of_point)
        return replace(cloud, points=cloud.means(points))

    def means(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """(M, C) float32 mean over the points of each voxel, given the (N, C) values of all points."""
        sums = [np.bincount(self.voxel_of_point, of, len(self.hits))[: len(self.hits)] for of in values.T]
        return (np.stack(sums, axis=1) / self.hits[:, None]).astype(np.float32)
