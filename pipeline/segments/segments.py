"""The map of segments: pieces of plane that grow and merge from frame to frame (thesis 3.2, figures 5 and 6)."""

from bisect import bisect
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.geometry.cells import JOINED
from pipeline.labels import Label
from pipeline.segments.gaps import Gaps, IsSurface
from pipeline.segments.members import Member
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segment import Segment

KEPT_EVERY = 64
"""Members from one kept state of the fold to the next: a fold begins at the last one before a keyframe that moved."""


class Segments:
    """All segments: patches that touch, and pieces of one plane whose gap the map holds, are one.

    Attributes:
        members: the patches of which the segments are made.
    """

    def __init__(self, is_surface: IsSurface | None = None) -> None:
        """No segments. Without ``is_surface`` every gap parts a surface."""
        self.members: list[Member] = []
        self._gaps = Gaps(is_surface)
        self._touching: list[Segment] = []
        self._bounds = np.zeros((0, 2, 3), np.int64)
        self._segments: list[Segment] = []
        # Pose of the keyframe of each member that was folded, and what every so many members had made.
        self._poses: list[NDArray[np.float64]] = []
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

    def update(self, patches: Iterable[PlanePatch], keyframe: int, T_map_base: NDArray[np.float64]) -> None:
        """Add the planes of a keyframe at a 4×4 pose; each is merged with all the segments that it continues."""
        for patch in patches:
            self.members.append(Member.of(patch, keyframe, T_map_base))
            self._add(len(self.members) - 1, T_map_base)
        self._segments = self._gaps.closed(self._touching)

    def rebuild(self, poses: NDArray[np.float64]) -> None:
        """Make all segments anew, as if each keyframe had been at its pose of (K, 4, 4) in ``map`` from the start."""
        at = [poses[member.keyframe] for member in self.members]
        is_same = [np.array_equal(old, new) for old, new in zip(self._poses, at, strict=False)]
        if False in is_same:
            kept = is_same.index(False) // KEPT_EVERY
            touching, self._bounds = self._kept[kept]
            self._touching = list(touching)
            del self._poses[KEPT_EVERY * kept :], self._kept[kept:]
        for number in range(len(self._poses), len(at)):
            self._add(number, at[number])
        self._segments = self._gaps.closed(self._touching)

    def _add(self, number: int, T_map_base: NDArray[np.float64]) -> None:
        """Add a member, merged with all that it continues: after a merger it may continue still more of them."""
        if number % KEPT_EVERY == 0:
            self._kept.append((list(self._touching), self._bounds))
        self._poses.append(T_map_base)
        new = Segment.placed(self.members[number], number, T_map_base)
        while (row := self._partner(new)) is not None:
            self._bounds = np.delete(self._bounds, row, axis=0)
            new = self._touching.pop(row).merged(new)
        row = bisect(self._touching, new.id, key=lambda segment: segment.id)
        self._touching.insert(row, new)
        self._bounds = np.insert(self._bounds, row, new.bounds, axis=0)

    def _partner(self, new: Segment) -> int | None:
        """The index of the oldest segment that a new one touches."""
        low, high = new.bounds
        near = (self._bounds[:, 0] <= high + JOINED) & (self._bounds[:, 1] >= low - JOINED)
        rows = np.flatnonzero(near.all(axis=1)).tolist()
        return next((row for row in rows if self._touching[row].touches(new)), None)
