"""A segment: a piece of plane in the map, made of the patches of one frame or many (thesis 3.2, figure 6)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from pipeline.geometry.cells import SURFACE_CELL, Cells, centres, in_contact, unite
from pipeline.geometry.cells_kernels import bounds, moved, placed_cells
from pipeline.labels import Label
from pipeline.segments.boxes import Box, Hull, bounding_box, corners
from pipeline.segments.members import Member
from pipeline.segments.plane import Moments, Plane


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of plane in the map. It is replaced, not changed, when it grows.

    Attributes:
        label: its class.
        plane: in ``map``; the normal of a traversable surface points upwards.
        box: around all its points.
        cells: (K, 3) int32, the 5 cm cells of the map in which it was seen: see :mod:`pipeline.geometry.cells`.
        moments: of its surfels.
        hull: of its points.
        members: indices of its patches in :attr:`Segments.members`, in order.
    """

    label: Label
    plane: Plane
    box: Box
    cells: Cells
    moments: Moments
    hull: Hull
    members: tuple[int, ...]

    @classmethod
    def of(
        cls,
        label: Label,
        side: NDArray[np.float64],
        cells: Cells,
        moments: Moments,
        hull: Hull,
        members: tuple[int, ...],
    ) -> Self:
        """A segment from its sums; its normal is on the side of the direction ``side`` (3,)."""
        plane, rms = moments.fit(side)
        # Two standard deviations of the noise to either side.
        return cls(label, plane, bounding_box(plane, moments.centroid, hull, 4 * rms), cells, moments, hull, members)

    @classmethod
    def placed(cls, member: Member, number: int, T_map_base: NDArray[np.float64]) -> Self:
        """The segment that a member with this number makes if its keyframe is at a 4×4 pose."""
        normal, moments = T_map_base[:3, :3] @ member.normal, member.moments.moved(T_map_base)
        cells, hull = (
            placed_cells(T_map_base, member.points, SURFACE_CELL),
            Hull.of(moved(T_map_base, member.outline)),
        )
        return cls.of(member.label, normal, cells, moments, hull, (number,))

    def merged(self, other: "Segment") -> "Segment":
        """One segment made of both."""
        cells, hull = unite(self.cells, other.cells), self.hull.union(other.hull)
        members = tuple(sorted(self.members + other.members))
        return Segment.of(self.label, self.plane.normal, cells, self.moments + other.moments, hull, members)

    @property
    def id(self) -> int:
        """The number of its oldest patch, which stays the same while it grows."""
        return self.members[0]

    @cached_property
    def bounds(self) -> NDArray[np.int64]:
        """(2, 3) the least and the greatest index of the cells along each axis."""
        return bounds(self.cells)

    @cached_property
    def tree(self) -> KDTree:
        """The k-d tree of the cells' centres."""
        return KDTree(centres(self.cells))

    def continues(self, other: "Segment") -> bool:
        """Whether both have one class and lie in one plane, seen from one side."""
        # Corners alone do not tell apart a surface and a narrow one that stands on it.
        if self.label != other.label or self.plane.normal @ other.plane.normal < 1 / 2:
            return False
        small, large = (self, other) if self.box.area < other.box.area else (other, self)
        offsets = np.abs(large.plane.distance(corners(small.box))) - small.box.extent[2] / 2
        return bool(offsets.max() <= SURFACE_CELL)

    def touches(self, other: "Segment") -> bool:
        """Whether both continue each other without a gap."""
        return self.continues(other) and in_contact(self.cells, other.cells)
