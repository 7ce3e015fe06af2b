"""An endless 3D array of int8, kept as cubic blocks that come into being where something is written."""

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

SIDE = 64
"""Voxels along a side of a block."""

Box = tuple[slice, slice, slice]


class BlockArray:
    """A 3D array without bounds: zero wherever nothing was written.

    It grows by whole blocks of ``SIDE``³ voxels, and what is there already stays where it is: finding a block is one
    look into a table, however many there are.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._blocks: dict[tuple[int, int, int], NDArray[np.int8]] = {}

    @property
    def nbytes(self) -> int:
        """Bytes of all blocks."""
        return len(self._blocks) * SIDE**3

    def pieces(
        self, lower: NDArray[np.int64], shape: tuple[int, ...], *, create: bool = False
    ) -> Iterator[tuple[Box, NDArray[np.int8]]]:
        """The parts of a box that lie in one block each.

        Args:
            lower: (3,) index of the box's first voxel.
            shape: of the box.
            create: make the blocks that are missing, instead of leaving them out.

        Yields:
            Where the part lies in the box, and a view of the part's voxels.

        Raises:
            InputError: if a new block would exceed the bound on memory.
        """
        first = lower // SIDE
        last = (lower + np.array(shape) - 1) // SIDE
        x, y, z = (range(a, b + 1) for a, b in zip(first.tolist(), last.tolist(), strict=True))
        for key in product(x, y, z):
            block = self._block(key) if create else self._blocks.get(key)
            if block is None:
                continue
            in_box, in_block = [], []
            for axis in range(3):
                corner = key[axis] * SIDE - int(lower[axis])
                begin, end = max(corner, 0), min(corner + SIDE, shape[axis])
                in_box.append(slice(begin, end))
                in_block.append(slice(begin - corner, end - corner))
            yield (in_box[0], in_box[1], in_box[2]), block[in_block[0], in_block[1], in_block[2]]

    def read(self, lower: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.int8]:
        """A copy of a box, int8."""
        result = np.zeros(shape, np.int8)
        for box, piece in self.pieces(lower, shape):
            result[box] = piece
        return result

    def write(self, lower: NDArray[np.int64], values: NDArray[np.int8]) -> None:
        """Overwrite a box."""
        for box, piece in self.pieces(lower, values.shape, create=True):
            piece[...] = values[box]

    def bounds(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(3,) first index and (3,) one past the last index of the box around all that is not zero."""
        corners = [
            corner + np.array(key) * SIDE for key, block in self._blocks.items() for corner in _extent(block)
        ]
        if not corners:
            return np.zeros(3, np.int64), np.zeros(3, np.int64)
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def _block(self, key: tuple[int, int, int]) -> NDArray[np.int8]:
        block = self._blocks.get(key)
        if block is None:
            if self.nbytes + SIDE**3 > self._max_bytes:
                raise InputError(f"the metric map would exceed its bound of {self._max_bytes} bytes")
            block = self._blocks[key] = np.zeros((SIDE, SIDE, SIDE), np.int8)
        return block


def _extent(block: NDArray[np.int8]) -> list[NDArray[np.int64]]:
    """First index and one past the last index of what is not zero in a block; nothing for an empty one."""
    filled = [np.flatnonzero(block.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    if not len(filled[0]):
        return []
    return [np.array([indices[0] for indices in filled]), np.array([indices[-1] + 1 for indices in filled])]
