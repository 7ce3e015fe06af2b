"""The map of segments: pieces of planes that grow and merge from frame to frame (thesis 3.2, figures 5 and 6)."""

from bisect import bisect
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose, Poses
from pipeline.labels import Label
from pipeline.segments.config import SegmentsConfig
from pipeline.segments.gaps import Gaps, IsSurface
from pipeline.segments.members import Member
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segment import Segment


class Segments:
    """All segments: touching patches form one, as do pieces of one plane if the metric map fills their gap.

    Attributes:
        members: the patches that the segments are made of.
        config: parameters of their planes, cells and boxes.
    """

    def __init__(self, is_surface: IsSurface | None = None, *, config: SegmentsConfig = SegmentsConfig()) -> None:
        """Start without segments. Without ``is_surface``, every gap separates two segments."""
        self.config = config
        self.members: list[Member] = []
        self._gaps = Gaps(is_surface)
        self._touching: list[Segment] = []
        self._bounds = np.zeros((0, 2, 3), np.int64)
        self._segments: list[Segment] = []
        # Keyframe pose of each member added so far, and the state saved before every ``checkpoint``-th member.
        self._poses: list[Pose] = []
        self._kept: list[tuple[list[Segment], NDArray[np.int64]]] = []

    def __len__(self) -> int:
        return len(self._segments)

    def __iter__(self) -> Iterator[Segment]:
        """The segments, oldest first."""
        return iter(self._segments)

    def __getitem__(self, id: int) -> Segment:
        """The segment with this id; KeyError if it never existed or was merged into an older one."""
        return {segment.id: segment for segment in self}[id]

    def of(self, *labels: Label) -> list[Segment]:
        """The segments of these classes, oldest first."""
        return [segment for segment in self if segment.label in labels]

    def update(self, patches: Iterable[PlanePatch], keyframe: int, T_map_base: Pose) -> None:
        """Add the planes of a keyframe at ``T_map_base``; each is merged with all segments that it touches."""
        for patch in patches:
            self.members.append(Member.of(patch, keyframe, T_map_base, self.config.cells.edge))
            self._add(len(self.members) - 1, T_map_base)
        self._segments = self._gaps.closed(self._touching)

    def rebuild(self, poses: Poses) -> None:
        """Rebuild all segments, as if each keyframe had had its pose in ``poses`` from the start."""
        every = self.config.checkpoint
        at = [poses[member.keyframe] for member in self.members]
        is_same = [np.array_equal(old, new) for old, new in zip(self._poses, at, strict=False)]
        if False in is_same:
            kept = is_same.index(False) // every
            touching, self._bounds = self._kept[kept]
            self._touching = list(touching)
            del self._poses[every * kept :], self._kept[kept:]
        for number in range(len(self._poses), len(at)):
            self._add(number, at[number])
        self._segments = self._gaps.closed(self._touching)

    def _add(self, number: int, T_map_base: Pose) -> None:
        """Add a member, merged with all segments that it touches; after each merger it may touch further ones."""
        if number % self.config.checkpoint == 0:
            self._kept.append((list(self._touching), self._bounds))
        self._poses.append(T_map_base)
        new = Segment.placed(self.members[number], number, T_map_base, self.config)
        while (row := self._partner(new)) is not None:
            self._bounds = np.delete(self._bounds, row, axis=0)
            new = self._touching.pop(row).merged(new)
        row = bisect(self._touching, new.id, key=lambda segment: segment.id)
        self._touching.insert(row, new)
        self._bounds = np.insert(self._bounds, row, new.bounds, axis=0)

    def _partner(self, new: Segment) -> int | None:
        """The index of the oldest segment that ``new`` touches, or None."""
        (low, high), reach = new.bounds, self.config.cells.reach
        near = (self._bounds[:, 0] <= high + reach) & (self._bounds[:, 1] >= low - reach)
        rows = np.flatnonzero(near.all(axis=1)).tolist()
        return next((row for row in rows if self._touching[row].touches(new)), None)
