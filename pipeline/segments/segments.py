"""The map of segments: pieces of plane that grow and merge from frame to frame (thesis 3.2, figures 5 and 6)."""

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
    """All segments: patches that touch, and pieces of one plane whose gap the map holds, are one.

    Attributes:
        members: the patches of which the segments are made.
        config: of their planes, cells and boxes.
    """

    def __init__(self, is_surface: IsSurface | None = None, *, config: SegmentsConfig = SegmentsConfig()) -> None:
        """No segments. Without ``is_surface`` every gap parts a surface."""
        self.config = config
        self.members: list[Member] = []
        self._gaps = Gaps(is_surface)
        self._touching: list[Segment] = []
        self._bounds = np.zeros((0, 2, 3), np.int64)
        self._segments: list[Segment] = []
        # Pose of the keyframe of each member that was folded, and what each group of that many members made.
        self._poses: list[Pose] = []
        self._kept: list[tuple[list[Segment], NDArray[np.int64]]] = []

    def __len__(self) -> int:
        return len(self._segments)

    def __iter__(self) -> Iterator[Segment]:
        """The segments, oldest first."""
        return iter(self._segments)

    def __getitem__(self, id: int) -> Segment:
        """The segment of that id; KeyError if it never existed or was merged into an older one."""
        return {segment.id: segment for segment in self}[id]

    def of(self, *labels: Label) -> list[Segment]:
        """The segments of these classes, oldest first."""
        return [segment for segment in self if segment.label in labels]

    def update(self, patches: Iterable[PlanePatch], keyframe: int, T_map_base: Pose) -> None:
        """Add the planes of a keyframe at a pose; each is merged with all the segments that it continues."""
        for patch in patches:
            self.members.append(Member.of(patch, keyframe, T_map_base, self.config.cells.edge))
            self._add(len(self.members) - 1, T_map_base)
        self._segments = self._gaps.closed(self._touching)

    def rebuild(self, poses: Poses) -> None:
        """Make all segments anew, as if each keyframe had been at its pose from the start."""
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
        """Add a member, merged with all that it continues: after a merger it may continue still more of them."""
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
        """The index of the oldest segment that a new one touches."""
        (low, high), reach = new.bounds, self.config.cells.reach
        near = (self._bounds[:, 0] <= high + reach) & (self._bounds[:, 1] >= low - reach)
        rows = np.flatnonzero(near.all(axis=1)).tolist()
        return next((row for row in rows if self._touching[row].touches(new)), None)
