"""A segment: a piece of plane in the map, made of the patches of one frame or many (thesis 3.2, figure 6)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.spatial import KDTree

from pipeline.arrays import Cells, Direction, Pose
from pipeline.geometry.cells import SurfaceCells, centres, in_contact, unite
from pipeline.geometry.cells_kernels import bounds, placed_cells
from pipeline.geometry.moving_kernels import moved
from pipeline.geometry.planes import Moments, Plane
from pipeline.labels import Label
from pipeline.segments.boxes import Box, Hull, bounding_box, corners
from pipeline.segments.config import SegmentsConfig
from pipeline.segments.members import Member


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of plane in the map. It is replaced, not changed, when it grows.

    Attributes:
        label: its class.
        plane: in ``map``; the normal of a traversable surface points upwards.
        box: around all its points.
        cells: of the map in which it was seen.
        moments: of its surfels.
        hull: of its points.
        members: indices of its patches in :attr:`Segments.members`, in order.
        config: of the segments.
    """

    label: Label
    plane: Plane
    box: Box
    cells: SurfaceCells
    moments: Moments
    hull: Hull
    members: tuple[int, ...]
    config: SegmentsConfig

    @classmethod
    def of(
        cls,
        label: Label,
        side: Direction,
        cells: SurfaceCells,
        moments: Moments,
        hull: Hull,
        members: tuple[int, ...],
        config: SegmentsConfig,
    ) -> Self:
        """A segment from its sums, with its normal on this side."""
        plane, rms = moments.fit(side)
        thickness, edge = config.thickness * rms, config.cells.edge
        box = bounding_box(plane, moments.centroid, hull, thickness, config.ascent, edge)
        return cls(label, plane, box, cells, moments, hull, members, config)

    @classmethod
    def placed(cls, member: Member, number: int, T_map_base: Pose, config: SegmentsConfig) -> Self:
        """The segment that a member with this number makes if its keyframe is at a pose."""
        normal, moments = T_map_base[:3, :3] @ member.normal, member.moments.moved(T_map_base)
        cells = placed_cells(T_map_base, member.points, config.cells.edge)
        hull = Hull.of(moved(T_map_base, member.outline))
        return cls.of(member.label, normal, cells, moments, hull, (number,), config)

    def merged(self, other: "Segment") -> "Segment":
        """One segment made of both."""
        cells, hull = unite(self.cells, other.cells), self.hull.union(other.hull)
        members, moments = tuple(sorted(self.members + other.members)), self.moments + other.moments
        return Segment.of(self.label, self.plane.normal, cells, moments, hull, members, self.config)

    @property
    def id(self) -> int:
        """The number of its oldest patch, which stays the same while it grows."""
        return self.members[0]

    @property
    def cell(self) -> float:
        """Edge of its cells, m."""
        return self.config.cells.edge

    @cached_property
    def bounds(self) -> Cells:
        """The least and the greatest index of the cells along each axis."""
        return bounds(self.cells)

    @cached_property
    def tree(self) -> KDTree:
        """The k-d tree of the cells' centres."""
        return KDTree(centres(self.cells, self.cell))

    def continues(self, other: "Segment") -> bool:
        """Whether both have one class and lie in one plane, seen from one side."""
        if self.label != other.label or self.plane.normal @ other.plane.normal < self.config.least_cosine:
            return False
        small, large = (self, other) if self.box.area < other.box.area else (other, self)
        offsets = np.abs(large.plane.distance(corners(small.box))) - small.box.extent[2] / 2
        return bool(offsets.max() <= self.config.flatness)

    def touches(self, other: "Segment") -> bool:
        """Whether both continue each other without a gap."""
        return self.continues(other) and in_contact(self.cells, other.cells, self.config.cells)
