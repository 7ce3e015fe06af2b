"""The semantic map: a labelled point for every small voxel with returns (thesis 3.2, figure 3)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Boxes, Indices, Labels, Mask, Points, Probabilities
from pipeline.errors import InputError
from pipeline.geometry.voxel_hash_kernels import EMPTY, insert_all
from pipeline.grid_map import Grid, ensure_capacity
from pipeline.labels import COLOURS, Label
from pipeline.semantic_map.config import SemanticMapConfig
from pipeline.semantic_map.ply import write_ply
from pipeline.semantic_map.revision import Revision
from pipeline.semantic_map.semantic_map_kernels import BLOCK, COLUMN, GONE, accumulate, forget

EVERYWHERE = np.zeros(2, np.int64), np.zeros((0, 0), np.bool_)
"""The selection of all columns."""


class SemanticMap:
    """Labelled points, fused over all frames.

    Each point has the label of its most probable class, and :meth:`revise` makes the labels consistent with the other
    maps.

    Memory grows with the area of the surfaces seen, not with the number of frames. Voxels are kept in the order in
    which they were first hit, so the same frames in the same order give the same map.

    Attributes:
        config: settings of the map, including the size of its voxels.
    """

    def __init__(self, *, config: SemanticMapConfig = SemanticMapConfig()) -> None:
        """Start with an empty map, whose labels are not revised yet."""
        self.config = config
        self._revision: Revision | None = None
        self._cached_labels: Labels | None = None
        self._blocks, self._size, self._frames = 0, 0, 0
        self._block_keys = np.empty(0, np.int64)
        self._voxels = np.empty((0, 64), np.int32)
        self._rows = np.empty((0, 4 + len(Label)), np.float32)
        self._first_hit = np.empty(0, np.int64)
        self._free = np.empty(0, np.int32)
        self._cached_order: Indices | None = None
        self._columns = EVERYWHERE
        self._reserve(1)

    def __len__(self) -> int:
        return self._size - len(self._free)

    def update(
        self,
        points: Points,
        probabilities: Probabilities | NDArray[np.uint8],
        hits: NDArray[np.unsignedinteger] | None = None,
        keyframe: int | None = None,
    ) -> None:
        """Add the points of a frame.

        A voxel's class evidence is the sum of the probabilities of its points. The probabilities are not multiplied,
        because the errors of neighbouring pixels are correlated, so that a product would be overconfident.

        Args:
            points: points in ``map``; points that are not finite are left out.
            probabilities: their class probabilities, as float32 or as uint8 in units of 1/255.
            hits: (N,) number of returns averaged in each point; 1 if not given.
            keyframe: number of the frame, which determines the order of its voxels; by default the next number.

        Raises:
            InputError: the shapes of the arrays are wrong.
        """
        if points.shape != (len(points), 3) or probabilities.shape != (len(points), len(Label)):
            raise InputError(
                f"semantic map: points and probabilities must have shapes (N, 3) and (N, {len(Label)}), "
                f"not {points.shape} and {probabilities.shape}"
            )
        self._reserve(len(points))
        counts = np.ones(len(points), np.uint32) if hits is None else hits
        unit = 1 / 255 if probabilities.dtype == np.uint8 else 1.0
        number = self._frames if keyframe is None else keyframe
        self._frames = max(self._frames, number + 1)
        self._blocks, self._size, left = accumulate(
            points, probabilities, unit, counts, 1 / self.config.voxel, self._slots, self._block_of_slot, self._shift,
            self._block_keys, self._voxels, self._rows, self._first_hit, number << 32, self._columns, self._free,
            (self._blocks, self._size, len(self._free)),
        )  # fmt: skip
        self._free, self._cached_order, self._cached_labels = self._free[:left], None, None

    @contextmanager
    def rebuilding(self, boxes: Boxes) -> Iterator[Callable[[Boxes], Mask]]:
        """Empty the columns that boxes in ``map`` touch; the body of the ``with`` statement must fill them again.

        The body must add all frames that touch these columns, in their order. Other columns do not change.

        Yields:
            A function that returns whether each of other boxes touches these columns.
        """
        columns = Grid.around(boxes, COLUMN * BLOCK * self.config.voxel)
        within, meets = columns.touched_by(boxes)
        self._columns = columns.low, within
        blocks, first_hit = slice(self._blocks), self._first_hit[: self._size]
        gone = forget(self._block_keys[blocks], self._voxels[blocks], first_hit, self._columns)
        self._free, self._cached_order, self._cached_labels = np.concatenate([self._free, gone]), None, None
        try:
            yield meets
        finally:
            self._columns = EVERYWHERE

    @property
    def _order(self) -> Indices:
        """The rows of the voxels in the order in which they were first hit."""
        if self._cached_order is None:
            rows = np.flatnonzero(self._first_hit[: self._size] != GONE)
            self._cached_order = rows[np.argsort(self._first_hit[rows], kind="stable")]
        return self._cached_order

    def _reserve(self, more: int) -> None:
        """Make room for ``more`` blocks and voxels; doubling keeps the amortised cost of growth constant."""
        self._rows, self._first_hit = (
            ensure_capacity(values, self._size, more) for values in (self._rows, self._first_hit)
        )
        if self._blocks + more <= len(self._block_keys):
            return
        self._block_keys = ensure_capacity(self._block_keys, self._blocks, more)
        self._voxels = ensure_capacity(self._voxels, self._blocks, more)
        # Twice as many slots as blocks, because linear probing is fast as long as half of the slots are empty.
        size = 2 * len(self._block_keys)
        self._slots, self._block_of_slot = np.full(size, EMPTY, np.int64), np.empty(size, np.int32)
        self._shift = 64 - (size.bit_length() - 1)
        insert_all(self._slots, self._block_of_slot, self._shift, self._block_keys[: self._blocks])

    def points(self) -> Points:
        """The mean point of every voxel."""
        return self._rows[self._order, 1:4]

    def revise(self, revision: Revision) -> None:
        """Make the labels of present and future points consistent with the other maps."""
        self._revision, self._cached_labels = revision, None

    def labels(self) -> Labels:
        """The most probable class of every voxel (the lower id wins a tie), as last revised."""
        if self._cached_labels is None:
            labels = self._rows[self._order, 4:].argmax(axis=1).astype(np.uint8)
            revision = self._revision
            self._cached_labels = (
                labels if revision is None else revision.revised(self.points(), labels, self.config.voxel)
            )
        return self._cached_labels

    def probabilities(self) -> Probabilities:
        """The class probabilities of every voxel: the mean over all its returns."""
        rows = self._rows[self._order]
        return np.divide(rows[:, 4:], rows[:, :1], dtype=np.float32)

    def hits(self) -> NDArray[np.uint32]:
        """(M,) uint32 number of returns in every voxel."""
        return self._rows[self._order, 0].astype(np.uint32)

    def save(self, path: Path, has_gone: Callable[[Points], Mask] | None = None) -> None:
        """Write a binary PLY file: ``x y z``, the label's ``red green blue``, ``label``; InputError if this fails.

        ``has_gone``: returns which points (N, 3) are left out, because their surface is gone.
        """
        points, labels = self.points(), self.labels()
        if has_gone is not None:
            stays = ~has_gone(points)
            points, labels = points[stays], labels[stays]
        write_ply(path, points, COLOURS[labels], labels)
