"""The voxels of a person, from all observations: what only a few show belongs to something else."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Indices, Points
from pipeline.geometry.thinning import first_in_voxels
from pipeline.geometry.voxel_hash import first_of, voxels_of


@dataclass(frozen=True, eq=False)
class PersonVoxels:
    """The voxels that observations of one person show.

    Attributes:
        edge: edge length of a voxel, m.
        seen: a point in each voxel.
        shown: number of observations that show each voxel.
    """

    edge: float
    seen: Points
    shown: Indices

    @classmethod
    def of(cls, points: Points, edge: float) -> "PersonVoxels":
        """The voxels of one observation's points; ``edge`` in m."""
        first = first_in_voxels(points / edge)
        return cls(edge, points[first], np.ones(len(first), np.int64))

    @classmethod
    def joined(cls, observations: Sequence["PersonVoxels"]) -> "PersonVoxels":
        """The voxels of all the given observations, at least one."""
        seen, edge = np.concatenate([voxels.seen for voxels in observations]), observations[0].edge
        voxel, keys = voxels_of(seen / edge)
        shown = np.bincount(voxel, np.concatenate([voxels.shown for voxels in observations])).astype(np.int64)
        return cls(edge, seen[first_of(voxel, len(keys))], shown)

    def agreed(self, frames: float) -> Points:
        """A point in each voxel that at least ``frames`` observations show; in every voxel if there is none."""
        is_agreed = self.shown >= frames
        return self.seen[is_agreed] if is_agreed.any() else self.seen
