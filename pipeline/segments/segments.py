"""The map of segments: pieces of plane that grow and merge from look to look (thesis 3.2, figures 5 and 6)."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from pipeline.labels import Label
from pipeline.segments.boxes import Box, Hull, bounding_box, corners
from pipeline.segments.cells import Cells, centres, in_contact, unite
from pipeline.segments.plane import Moments, Plane
from pipeline.segments.planes import PlanePatch


@dataclass(frozen=True)
class SegmentsConfig:
    """When two pieces of plane are one.

    Attributes:
        max_angle: rad, between their normals.
        max_offset: m, of the smaller one's corners from the larger one's plane.
        min_thickness: m, of a box.
    """

    max_angle: float = np.deg2rad(12)
    max_offset: float = 0.05
    min_thickness: float = 0.02


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of plane in the map. It is replaced, not changed, when it grows.

    Attributes:
        id: stays the same while it grows; of merged segments the oldest one's stays.
        label: its class.
        plane: in ``map``; the normal points to the side from which it was seen, so upwards on what can be driven.
        box: around all that was seen of it.
        points: number of surfels that it was made of, over all looks.
        first_step: in which it was first seen.
        last_step: in which it was last seen.
        cells: (K, 3) int32, the 5 cm cells of the map that it was seen in: see :mod:`pipeline.segments.cells`.
        moments: of its surfels.
        hull: of its points.
    """

    id: int
    label: Label
    plane: Plane
    box: Box
    points: int
    first_step: int
    last_step: int
    cells: Cells
    moments: Moments
    hull: Hull

    @cached_property
    def tree(self) -> KDTree:
        """Of the cells' centres."""
        return KDTree(centres(self.cells))


class Segments:
    """All segments, by id. No points are kept: a plane's sums, a hull and coarse cells say what later looks need."""

    def __init__(self, config: SegmentsConfig | None = None) -> None:
        """No segments yet."""
        self.config = config or SegmentsConfig()
        self._segments: dict[int, Segment] = {}
        self._next_id = 0

    def __len__(self) -> int:
        """Number of segments."""
        return len(self._segments)

    def __iter__(self) -> Iterator[Segment]:
        """The segments, oldest first."""
        return iter(sorted(self._segments.values(), key=lambda segment: segment.id))

    def __getitem__(self, id: int) -> Segment:
        """The segment of that id; KeyError if it never was or was merged into an older one."""
        return self._segments[id]

    def of(self, *labels: Label) -> list[Segment]:
        """The segments of these classes, oldest first."""
        return [segment for segment in self if segment.label in labels]

    def update(self, patches: Iterable[PlanePatch], step: int) -> None:
        """Add the planes of one look, each to all the segments that it continues."""
        for patch in patches:
            self._add(self._segment_of(patch, step))

    def _add(self, new: Segment) -> None:
        """A piece may join several segments, and what they have become may reach still more."""
        while (partner := next((old for old in self if self._are_one(old, new)), None)) is not None:
            del self._segments[partner.id]
            new = self._merged(partner, new)
        self._segments[new.id] = new
        self._next_id = max(self._next_id, new.id + 1)

    def _are_one(self, a: Segment, b: Segment) -> bool:
        if a.label != b.label or a.plane.normal @ b.plane.normal < np.cos(self.config.max_angle):
            return False
        small, large = (a, b) if a.box.area < b.box.area else (b, a)
        offsets = np.abs(large.plane.distance(corners(small.box))) - small.box.extent[2] / 2
        return bool(offsets.max() <= self.config.max_offset) and in_contact(a.cells, b.cells)

    def _segment_of(self, patch: PlanePatch, step: int) -> Segment:
        return self._segment(
            self._next_id,
            patch.label,
            patch.plane,
            patch.moments,
            Hull.of(patch.points),
            patch.cells,
            step,
            step,
        )

    def _merged(self, a: Segment, b: Segment) -> Segment:
        return self._segment(
            min(a.id, b.id),
            a.label,
            a.plane,
            a.moments + b.moments,
            a.hull.union(b.hull),
            unite(a.cells, b.cells),
            min(a.first_step, b.first_step),
            max(a.last_step, b.last_step),
        )

    def _segment(
        self,
        id: int,
        label: Label,
        side: Plane,
        moments: Moments,
        hull: Hull,
        cells: Cells,
        first_step: int,
        last_step: int,
    ) -> Segment:
        """A segment from its sums; ``side`` is any plane whose normal points to the side that was seen."""
        plane, rms = moments.fit()
        plane = plane.facing(side.normal)
        box = bounding_box(plane, moments.centroid, hull, max(self.config.min_thickness, 4 * rms))
        return Segment(id, label, plane, box, moments.count, first_step, last_step, cells, moments, hull)
