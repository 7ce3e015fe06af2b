"""The map of segments: pieces of planes that grow and merge from frame to frame (thesis 3.2, figures 5 and 6)."""

from bisect import bisect
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import DisjointSet

from pipeline.arrays import Direction, Mask, Places, Pose, Poses
from pipeline.geometry.cells import MIN_FRONT_CELLS, REACH
from pipeline.labels import Label
from pipeline.segments.config import SegmentsConfig
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segment import Member, Segment

IsSurface = Callable[[Places, Direction], Mask]
"""Function that takes positions and a normal, and returns which positions lie on surfaces of the metric map.

The surfaces face the side to which the normal points. The positions and the result have the shapes (N, 3) and (N,).
"""


@dataclass(frozen=True, eq=False)
class Gap:
    """The straight lines across a gap between two segments, from the smaller segment's cells nearest to the larger.

    Attributes:
        width: smallest Chebyshev distance between centres of the segments' cells, along the axes of the map, m.
        start, end: ends of the lines, in the plane of the larger segment.
        normal: normal of this plane.
        cell: edge length of the segments' cells, m.
    """

    width: float
    start: Places
    end: Places
    normal: Direction
    cell: float

    @classmethod
    def between(cls, a: Segment, b: Segment) -> Self | None:
        """The gap between two segments of one plane; None if only their corners face each other."""
        small, large = (a, b) if a.box.area < b.box.area else (b, a)
        widths, nearest = large.tree.query(small.tree.data, p=np.inf)
        edge = large.cell
        front = widths < widths.min() + (REACH + 1 / 2) * edge
        if np.count_nonzero(front) < MIN_FRONT_CELLS:
            return None
        start = large.plane.projected(small.tree.data[front])
        end = large.plane.projected(large.tree.data[nearest[front]])
        return cls(float(widths.min()), start, end, large.plane.normal, edge)

    def is_closed(self, is_surface: IsSurface) -> bool:
        """Whether most of the lines lie on a surface, which is tested at points at most a cell apart."""
        start, way, parts = self.start, self.end - self.start, 1
        while 2 * len(start) > len(self.start):
            if parts * self.cell >= self.width:
                return True
            between = np.arange(1 / 2, parts) / parts
            points = start[:, None] + between[:, None] * way[:, None]
            holds = is_surface(points.reshape(-1, 3), self.normal).reshape(len(start), -1).all(axis=1)
            start, way, parts = start[holds], way[holds], 2 * parts
        return False


class GapCloser:
    """Joins segments across gaps that the metric map fills.

    During a drive, few keyframes are labelled, but all are in the metric map. Two segments are therefore joined if
    the metric map contains a surface along the straight lines across the gap between them. Across a doorway, the
    metric map contains no surface.
    """

    def __init__(self, is_surface: IsSurface | None) -> None:
        """``is_surface``: test for points on surfaces of the metric map; if None, no gap is closed."""
        self._is_surface = is_surface
        self._gaps: dict[tuple[Segment, Segment], Gap | None] = {}
        self._joined: dict[tuple[Segment, ...], Segment] = {}

    def joined(self, segments: Sequence[Segment]) -> list[Segment]:
        """The segments, oldest first, after joining them across closed gaps."""
        if self._is_surface is None:
            return list(segments)
        before = self._gaps
        self._gaps = {}
        for pair in _neighbour_pairs(segments):
            self._gaps[pair] = before[pair] if pair in before else Gap.between(*pair)
        joined = DisjointSet(segments)
        for pair, gap in self._gaps.items():
            if gap and gap.is_closed(self._is_surface):
                joined.merge(*pair)
        whole = self._joined
        self._joined = {}
        for group in (tuple(sorted(group, key=_id)) for group in joined.subsets()):
            self._joined[group] = whole[group] if group in whole else reduce(Segment.merged, group)
        return sorted(self._joined.values(), key=_id)


def _neighbour_pairs(segments: Sequence[Segment]) -> Iterator[tuple[Segment, Segment]]:
    """Yield the pairs of segments that continue each other, unless a third one in their plane is nearer to both."""
    low, high = np.array([segment.bounds for segment in segments]).reshape(-1, 2, 3).swapaxes(0, 1)
    distance = np.full((len(segments), len(segments)), np.inf)
    pairs = [pair for pair in _coplanar_pairs(segments) if segments[pair[0]].continues(segments[pair[1]])]
    for a, b in pairs:
        distance[a, b] = distance[b, a] = np.maximum(low[a] - high[b], low[b] - high[a]).max()
    for a, b in pairs:
        if not (np.maximum(distance[a], distance[b]) < distance[a, b]).any():
            yield segments[a], segments[b]


def _coplanar_pairs(segments: Sequence[Segment]) -> list[list[int]]:
    """Index pairs of segments that face the same side, if the centre of either lies in the plane of the other."""
    middles = np.array([segment.box.T_map_box[:3, 3] for segment in segments]).reshape(-1, 3)
    normals = np.array([segment.plane.normal for segment in segments]).reshape(-1, 3)
    offsets = [segment.plane.offset for segment in segments]
    is_near = np.abs(middles @ normals.T - offsets) <= [segment.config.flatness for segment in segments]
    return np.argwhere(np.triu((is_near | is_near.T) & (normals @ normals.T > 0), 1)).tolist()


def _id(segment: Segment) -> int:
    return segment.id


class Segments:
    """All segments of the map.

    Touching patches form one segment, as do pieces of one plane if the metric map fills the gap between them.

    Attributes:
        members: data of the patches of which the segments consist.
        config: parameters of the segments.
    """

    def __init__(self, is_surface: IsSurface | None = None, *, config: SegmentsConfig = SegmentsConfig()) -> None:
        """Start without segments; if ``is_surface`` is None, every gap separates two segments."""
        self.config = config
        self.members: list[Member] = []
        self._gaps = GapCloser(is_surface)
        self._touching: list[Segment] = []
        self._bounds = np.zeros((0, 2, 3), np.int64)
        self._segments: list[Segment] = []
        # Keyframe pose of each member added so far, and the state saved every ``checkpoint_interval`` members.
        self._poses: list[Pose] = []
        self._checkpoints: list[tuple[list[Segment], NDArray[np.int64]]] = []

    def __len__(self) -> int:
        return len(self._segments)

    def __iter__(self) -> Iterator[Segment]:
        """The segments, oldest first."""
        return iter(self._segments)

    def of(self, *labels: Label) -> list[Segment]:
        """The segments of these classes, oldest first."""
        return [segment for segment in self if segment.label in labels]

    def update(self, patches: Iterable[PlanePatch], keyframe: int, T_map_base: Pose) -> None:
        """Add the patches of a keyframe at ``T_map_base``; each patch is merged with all segments that it touches."""
        for patch in patches:
            self.members.append(Member.of(patch, keyframe, T_map_base, self.config.cell))
            self._add(len(self.members) - 1, T_map_base)
        self._segments = self._gaps.joined(self._touching)

    def rebuild(self, poses: Poses) -> None:
        """Rebuild all segments as if the keyframes had had the poses ``poses`` from the start."""
        every = self.config.checkpoint_interval
        at = [poses[member.keyframe] for member in self.members]
        is_same = [np.array_equal(old, new) for old, new in zip(self._poses, at, strict=False)]
        if False in is_same:
            kept = is_same.index(False) // every
            touching, self._bounds = self._checkpoints[kept]
            self._touching = list(touching)
            del self._poses[every * kept :], self._checkpoints[kept:]
        for number in range(len(self._poses), len(at)):
            self._add(number, at[number])
        self._segments = self._gaps.joined(self._touching)

    def _add(self, number: int, T_map_base: Pose) -> None:
        """Add a member, and merge it with the segments that it touches until the merged segment touches no other."""
        if number % self.config.checkpoint_interval == 0:
            self._checkpoints.append((list(self._touching), self._bounds))
        self._poses.append(T_map_base)
        new = Segment.placed(self.members[number], number, T_map_base, self.config)
        while (row := self._oldest_touching(new)) is not None:
            self._bounds = np.delete(self._bounds, row, axis=0)
            new = self._touching.pop(row).merged(new)
        row = bisect(self._touching, new.id, key=lambda segment: segment.id)
        self._touching.insert(row, new)
        self._bounds = np.insert(self._bounds, row, new.bounds, axis=0)

    def _oldest_touching(self, new: Segment) -> int | None:
        """The index of the oldest segment that ``new`` touches, or None."""
        low, high = new.bounds
        near = (self._bounds[:, 0] <= high + REACH) & (self._bounds[:, 1] >= low - REACH)
        rows = np.flatnonzero(near.all(axis=1)).tolist()
        return next((row for row in rows if self._touching[row].touches(new)), None)
