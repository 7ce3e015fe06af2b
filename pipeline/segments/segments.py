"""The map of segments: pieces of plane that grow and merge from frame to frame (thesis 3.2, figures 5 and 6)."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from pipeline.labels import Label
from pipeline.segments.boxes import Box, Hull, bounding_box, corners
from pipeline.segments.cells import REACH, Cells, centres, in_contact, unite
from pipeline.segments.members import Member, MovedMembers
from pipeline.segments.plane import Moments, Plane
from pipeline.segments.planes import PlanePatch

MAX_ANGLE = np.deg2rad(12)  # rad, between the normals of two pieces of one plane
MAX_OFFSET = 0.05  # m, of the smaller piece's corners from the larger piece's plane
MIN_THICKNESS = 0.02  # m, of a box


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of plane in the map. It is replaced, not changed, when it grows.

    Attributes:
        id: stays the same while it grows; merged segments keep the oldest one's id.
        label: its class.
        plane: in ``map``; the normal of a traversable surface points upwards.
        box: around all its points.
        first_step: the step in which it was first seen.
        last_step: the step in which it was last seen.
        cells: (K, 3) int32, the 5 cm cells of the map in which it was seen: see :mod:`pipeline.segments.cells`.
        moments: of its surfels.
        hull: of its points.
        members: indices of its patches in :attr:`Segments.members`.
    """

    id: int
    label: Label
    plane: Plane
    box: Box
    first_step: int
    last_step: int
    cells: Cells
    moments: Moments
    hull: Hull
    members: tuple[int, ...]

    @classmethod
    def of(
        cls,
        id: int,
        label: Label,
        side: NDArray[np.float64],
        steps: tuple[int, int],
        cells: Cells,
        moments: Moments,
        hull: Hull,
        members: tuple[int, ...] = (),
    ) -> Self:
        """A segment from its sums; its normal is on the side of the direction ``side`` (3,)."""
        plane, rms = moments.fit(side)
        box = bounding_box(plane, moments.centroid, hull, max(MIN_THICKNESS, 4 * rms))
        return cls(id, label, plane, box, *steps, cells, moments, hull, members)

    def merged(self, other: "Segment") -> "Segment":
        """One segment made of both."""
        steps = min(self.first_step, other.first_step), max(self.last_step, other.last_step)
        cells, moments = unite(self.cells, other.cells), self.moments + other.moments
        hull, members = self.hull.union(other.hull), self.members + other.members
        return Segment.of(min(self.id, other.id), self.label, self.plane.normal, steps, cells, moments, hull, members)

    @cached_property
    def bounds(self) -> tuple[list[int], list[int]]:
        """The least and the greatest index of the cells along each axis."""
        return self.cells.min(axis=0).tolist(), self.cells.max(axis=0).tolist()

    @cached_property
    def tree(self) -> KDTree:
        """The k-d tree of the cells' centres."""
        return KDTree(centres(self.cells))


class Segments:
    """All segments, by id. Later frames need only their sums, hulls and coarse cells, no points.

    Attributes:
        members: the patches of which the segments are made.
    """

    def __init__(self) -> None:
        self._segments: dict[int, Segment] = {}
        self.members: list[Member] = []
        self._motions = np.zeros((0, 4, 4))
        self._added: dict[int, NDArray[np.float64]] = {}
        self._next_id = 0

    def __len__(self) -> int:
        return len(self._segments)

    def __iter__(self) -> Iterator[Segment]:
        """The segments, oldest first."""
        return iter(sorted(self._segments.values(), key=lambda segment: segment.id))

    def __getitem__(self, id: int) -> Segment:
        """The segment of that id; KeyError if it never existed or was merged into an older one."""
        return self._segments[id]

    def of(self, *labels: Label) -> list[Segment]:
        """The segments of these classes, oldest first."""
        return [segment for segment in self if segment.label in labels]

    def update(self, patches: Iterable[PlanePatch], step: int, T_map_base: NDArray[np.float64]) -> None:
        """Add the planes of one frame; each is merged with all the segments that it continues."""
        self._added[step] = T_map_base
        for p in patches:
            hull, steps, members = Hull.of(p.points), (step, step), (len(self.members),)
            self.members.append(Member.of(p, step))
            self._add(Segment.of(self._next_id, p.label, p.plane.normal, steps, p.cells, p.moments, hull, members))

    def rebuild(self, poses: NDArray[np.float64]) -> None:
        """Rebuild."""
        motions = np.array([T @ np.linalg.inv(self._added.get(k, T)) for k, T in enumerate(poses)])
        self.correct(motions)

    def correct(self, motions: NDArray[np.float64]) -> None:
        """Rebuild all segments from their patches, split off patches that moved away, and merge segments that meet.

        Args:
            motions: (N, 4, 4) of every step, from ``map`` as it was when its patches were added to ``map`` as it is.
        """
        if not self.members:
            return
        before = np.concatenate([self._motions, np.tile(np.eye(4), (len(motions) - len(self._motions), 1, 1))])
        old, new = MovedMembers(self.members, before), MovedMembers(self.members, motions)
        self._motions = motions
        segments, self._segments = list(self), {}
        apart: list[tuple[Label, int]] = []
        for segment in segments:
            rows = np.array(segment.members)
            reference = int(rows[new.counts[rows].argmax()])
            stays = new.misfits(rows, reference) - old.misfits(rows, reference) <= MAX_OFFSET
            apart += [(segment.label, int(row)) for row in rows[~stays]]
            self._add(self._made(segment.id, segment.label, rows[stays], new))
        for label, row in apart:
            self._add(self._made(self._next_id, label, np.array([row]), new))

    def restore(self, members: list[Member], ids: NDArray[np.int64], labels: NDArray[np.uint8]) -> None:
        """Restore an earlier episode's segments from its members, with each one's segment id (P,) and class (P,)."""
        self.members = members
        if members:
            poses = MovedMembers(members, np.tile(np.eye(4), (max(m.step for m in members) + 1, 1, 1)))
            for id in np.unique(ids).tolist():
                rows = np.flatnonzero(ids == id)
                self._segments[id] = self._made(id, Label(labels[rows[0]]), rows, poses)
                self._next_id = id + 1

    def _made(self, id: int, label: Label, rows: NDArray[np.intp], moved: MovedMembers) -> Segment:
        """A segment of these members."""
        steps = [self.members[row].step for row in rows]
        hull = Hull.of(np.concatenate([moved.outline(row) for row in rows]).astype(np.float32))
        side, moments = moved.normals[rows].sum(axis=0), moved.moments(rows)
        members, cells = tuple(rows.tolist()), moved.cells(rows)
        return Segment.of(id, label, side, (min(steps), max(steps)), cells, moments, hull, members)

    def _add(self, new: Segment) -> None:
        """Add a segment, merged with all that it continues: after a merger it may continue still more of them."""
        while (partner := next((old for old in self if _are_one(old, new)), None)) is not None:
            del self._segments[partner.id]
            new = partner.merged(new)
        self._segments[new.id] = new
        self._next_id = max(self._next_id, new.id + 1)


def _are_one(a: Segment, b: Segment) -> bool:
    """Whether two segments continue each other: same class, one plane, in contact."""
    if a.label != b.label or _are_apart(a, b) or a.plane.normal @ b.plane.normal < np.cos(MAX_ANGLE):
        return False
    small, large = (a, b) if a.box.area < b.box.area else (b, a)
    offsets = np.abs(large.plane.distance(corners(small.box))) - small.box.extent[2] / 2
    return bool(offsets.max() <= MAX_OFFSET) and in_contact(a.cells, b.cells)


def _are_apart(a: Segment, b: Segment) -> bool:
    """Whether the bounding boxes of their cells show that two segments are not in contact."""
    (a_low, a_high), (b_low, b_high) = a.bounds, b.bounds
    return any(a_low[k] > b_high[k] + REACH or b_low[k] > a_high[k] + REACH for k in range(3))
