"""The voxels that contain points, found with a hash table, whose memory grows only with the number of voxels."""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices
from pipeline.geometry import voxel_hash_kernels as kernels


def voxels_of(points: NDArray[np.floating], per_unit: float | np.floating = 1.0) -> tuple[Indices, NDArray[np.int64]]:
    """(N,) index of the key of each point's voxel, for points (N, 3), and the (M,) sorted keys of all these voxels.

    The index is M for points that are not finite or too far from the origin for a key. ``per_unit`` is the number of
    voxels per unit of the points' coordinates. The coordinates are multiplied by it in their own precision, because
    dividing them beforehand would round differently at the faces of voxels.
    """
    of_point, keys = kernels.voxels_of(points, points.dtype.type(per_unit))
    order = keys.argsort()
    number = np.append(np.empty(len(keys), np.int64), len(keys))
    number[order] = np.arange(len(keys))
    return number[of_point], keys[order]


def first_points(voxel_of_point: Indices, count: int) -> Indices:
    """(``count``,) index of the first point in each voxel, given each point's voxel, as from :func:`voxels_of`."""
    first = np.empty(count + 1, np.int64)
    first[voxel_of_point[::-1]] = np.arange(len(voxel_of_point))[::-1]
    return first[:count]
