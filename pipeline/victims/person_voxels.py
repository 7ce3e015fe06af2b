"""Where a person is, by all observations of it: what few of them show is of something else."""

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
        edge: of a voxel, m.
        seen: a point in each voxel.
        shown: in how many observations each is.
    """

    edge: float
    seen: Points
    shown: Indices

    @classmethod
    def of(cls, points: Points, edge: float) -> "PersonVoxels":
        """Of one observation's points; ``edge`` in m."""
        first = first_in_voxels(points / edge)
        return cls(edge, points[first], np.ones(len(first), np.int64))

    @classmethod
    def joined(cls, observations: Sequence["PersonVoxels"]) -> "PersonVoxels":
        """Of all of these observations, at least one."""
        seen, edge = np.concatenate([voxels.seen for voxels in observations]), observations[0].edge
        voxel, keys = voxels_of(seen / edge)
        shown = np.bincount(voxel, np.concatenate([voxels.shown for voxels in observations])).astype(np.int64)
        return cls(edge, seen[first_of(voxel, len(keys))], shown)

    def agreed(self, frames: float) -> Points:
        """The person's voxels that occur in at least this many observations; all of them if none does."""
        is_agreed = self.shown >= frames
        return self.seen[is_agreed] if is_agreed.any() else self.seen
