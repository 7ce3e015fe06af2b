"""Where a person is, by all observations of it: what few of them show is of something else."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.geometry.thinning import first_in_voxels
from pipeline.geometry.voxel_hash import first_of, voxels_of

VOXEL = 0.03  # m
AGREED = 0.2
"""Least share of the frames with a person that show a voxel of it."""


@dataclass(frozen=True, eq=False)
class PersonVoxels:
    """The voxels that observations of one person show.

    Attributes:
        seen: (N, 3) float32 a point in each voxel, m in ``map``.
        shown: (N,) int64 in how many observations each is.
    """

    seen: NDArray[np.float32]
    shown: NDArray[np.int64]

    @classmethod
    def of(cls, points: NDArray[np.float32]) -> "PersonVoxels":
        """Of one observation's points (N, 3), m in ``map``."""
        first = first_in_voxels(points / VOXEL)
        return cls(points[first], np.ones(len(first), np.int64))

    @classmethod
    def joined(cls, observations: Sequence["PersonVoxels"]) -> "PersonVoxels":
        """Of all of these observations, at least one."""
        seen = np.concatenate([voxels.seen for voxels in observations])
        voxel, keys = voxels_of(seen / VOXEL)
        shown = np.bincount(voxel, np.concatenate([voxels.shown for voxels in observations])).astype(np.int64)
        return cls(seen[first_of(voxel, len(keys))], shown)

    def agreed(self, frames: int) -> NDArray[np.float32]:
        """(M, 3) float32 of the person whom so many frames show, m in ``map``; all if none shows often enough."""
        is_agreed = self.shown >= AGREED * frames
        return self.seen[is_agreed] if is_agreed.any() else self.seen
