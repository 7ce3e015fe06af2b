"""A segment: a piece of a plane in the map, made of patches from one or more frames (thesis 3.2, figure 6)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import cv2
import numpy as np
from scipy.spatial import KDTree

from pipeline.arrays import Cells, Direction, Points, Pose
from pipeline.geometry.cells import SurfaceCells, centres, in_contact, unite
from pipeline.geometry.cells_kernels import bounds, placed_cells
from pipeline.geometry.moving_kernels import moved
from pipeline.geometry.planes import Moments, Plane
from pipeline.geometry.thinning import first_in_voxels
from pipeline.labels import Label
from pipeline.segments.boxes import Hull, OrientedBox, bounding_box, corners
from pipeline.segments.config import SegmentsConfig
from pipeline.segments.planes import PlanePatch
from pipeline.transforms import inverse, transform_points

MIN_COSINE = 0.5
"""Minimum cosine of the angle between the normals of segments that continue each other.

The corners of boxes alone do not distinguish a surface from a narrow surface that stands on it.
"""
THICKNESS_SIGMAS = 4.0
"""Thickness of a box, in standard deviations of the noise: two on either side."""


@dataclass(frozen=True, eq=False)
class Member:
    """The data kept from a patch, in ``base_link`` of the keyframe that shows the patch.

    Attributes:
        keyframe: index of the keyframe.
        label: class of the patch.
        normal: normal of the patch's plane.
        moments: moments of the patch's surfels.
        outline: corners of the convex hull of the patch's points.
        points: one of the patch's points per voxel; a voxel has half the edge length of a cell.
    """

    keyframe: int
    label: Label
    normal: Direction
    moments: Moments
    outline: Points
    points: Points

    @classmethod
    def of(cls, patch: PlanePatch, keyframe: int, T_map_base: Pose, cell: float) -> Self:
        """The member for a patch that a keyframe at ``T_map_base`` shows; ``cell``: edge length of a cell, m."""
        across = np.eye(3)[np.abs(patch.plane.normal).argmin()]
        u = np.cross(patch.plane.normal, across)
        v = np.cross(patch.plane.normal, u)
        flat = np.ascontiguousarray(patch.points @ np.stack([u, v], axis=1), np.float32)
        corners = cv2.convexHull(flat, returnPoints=False)[:, 0]
        T = inverse(T_map_base)
        kept = first_in_voxels(patch.points, 2 / cell)
        outline, points = (transform_points(T, patch.points[some]) for some in (corners, kept))
        return cls(keyframe, patch.label, T[:3, :3] @ patch.plane.normal, patch.moments.moved(T), outline, points)


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of a plane in the map; a segment that grows is replaced by a new one.

    Attributes:
        label: class of the surface.
        plane: plane in ``map``; the normal of a traversable surface points upwards.
        box: bounding box of all points of the segment.
        cells: cells of the map in which the segment was seen.
        moments: moments of the segment's surfels.
        hull: hull of the segment's points.
        members: indices of the segment's patches in :attr:`Segments.members`, ascending.
        config: parameters of the segments.
    """

    label: Label
    plane: Plane
    box: OrientedBox
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
        """Create a segment and compute its plane and box; the plane's normal points to the same side as ``side``."""
        plane, rms = moments.fit(side)
        thickness = THICKNESS_SIGMAS * rms
        edge = config.cell
        box = bounding_box(plane, moments.centroid, hull, thickness, edge)
        return cls(label, plane, box, cells, moments, hull, members, config)

    @classmethod
    def placed(cls, member: Member, number: int, T_map_base: Pose, config: SegmentsConfig) -> Self:
        """The segment that consists only of the member with this number, whose keyframe is at ``T_map_base``."""
        normal = T_map_base[:3, :3] @ member.normal
        moments = member.moments.moved(T_map_base)
        cells = placed_cells(T_map_base, member.points, config.cell)
        hull = Hull.of(moved(T_map_base, member.outline))
        return cls.of(member.label, normal, cells, moments, hull, (number,), config)

    def merged(self, other: "Segment") -> "Segment":
        """The union of both segments."""
        cells = unite(self.cells, other.cells)
        moments = self.moments + other.moments
        hull = self.hull.union(other.hull)
        members = tuple(sorted(self.members + other.members))
        return Segment.of(self.label, self.plane.normal, cells, moments, hull, members, self.config)

    @property
    def id(self) -> int:
        """The index of the segment's oldest patch, which stays the same when newer patches join the segment."""
        return self.members[0]

    @property
    def cell(self) -> float:
        """Edge length of the segment's cells, m."""
        return self.config.cell

    @cached_property
    def bounds(self) -> Cells:
        """(2, 3) minimum and maximum index of the cells along each axis."""
        return bounds(self.cells)

    @cached_property
    def tree(self) -> KDTree:
        """The k-d tree of the cells' centres."""
        return KDTree(centres(self.cells, self.cell))

    def continues(self, other: "Segment") -> bool:
        """Whether both segments have the same class and lie in one plane, seen from the same side."""
        if self.label != other.label or self.plane.normal @ other.plane.normal < MIN_COSINE:
            return False
        small, large = (self, other) if self.box.area < other.box.area else (other, self)
        offsets = np.abs(large.plane.distance(corners(small.box))) - small.box.extent[2] / 2
        return bool(offsets.max() <= self.config.flatness)

    def touches(self, other: "Segment") -> bool:
        """Whether both segments continue each other without a gap."""
        return self.continues(other) and in_contact(self.cells, other.cells)
