"""An endless 3D array of int8, kept as cubic blocks that come into being where something is written."""

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

SIDE = 64
"""Voxels along a side of a block."""

Key = tuple[int, int, int]
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

    def __contains__(self, key: Key) -> bool:
        return key in self._blocks

    def block(self, key: Key) -> NDArray[np.int8]:
        """(SIDE, SIDE, SIDE) int8, the block itself; it comes into being if it is not there.

        Raises:
            InputError: if it would exceed the bound on memory.
        """
        block = self._blocks.get(key)
        if block is None:
            if self.nbytes + SIDE**3 > self._max_bytes:
                raise InputError(f"the metric map would exceed its bound of {self._max_bytes} bytes")
            block = self._blocks[key] = np.zeros((SIDE, SIDE, SIDE), np.int8)
        return block

    def read(self, lower: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.int8]:
        """A copy of a box, int8."""
        result = np.zeros(shape, np.int8)
        for key, in_box, in_block in parts(lower, shape):
            if key in self._blocks:
                result[in_box] = self._blocks[key][in_block]
        return result

    def write(self, lower: NDArray[np.int64], values: NDArray[np.int8]) -> None:
        """Overwrite a box."""
        for key, in_box, in_block in parts(lower, values.shape):
            if values[in_box].any():
                self.block(key)[in_block] = values[in_box]

    def bounds(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(3,) first index and (3,) one past the last index of the box around all that is not zero."""
        corners = [
            corner + np.array(key) * SIDE for key, block in self._blocks.items() for corner in _extent(block)
        ]
        if not corners:
            return np.zeros(3, np.int64), np.zeros(3, np.int64)
        return np.min(corners, axis=0), np.max(corners, axis=0)


def parts(lower: NDArray[np.int64], shape: tuple[int, ...]) -> Iterator[tuple[Key, Box, Box]]:
    """The parts of a box, given by its first index and its shape, that lie in one block each.

    Yields:
        The block's key, where the part lies in the box and where in the block.
    """
    axes = [_parts_of_axis(first, length) for first, length in zip(lower.tolist(), shape, strict=True)]
    for part in product(*axes):
        (a, i, u), (b, j, v), (c, k, w) = part
        yield (a, b, c), (i, j, k), (u, v, w)


def _parts_of_axis(first: int, length: int) -> list[tuple[int, slice, slice]]:
    """Along one axis: number of the block, indices in the box and indices in the block."""
    result = []
    for block in range(first // SIDE, -(-(first + length) // SIDE)):
        corner = block * SIDE - first
        begin, end = max(corner, 0), min(corner + SIDE, length)
        result.append((block, slice(begin, end), slice(begin - corner, end - corner)))
    return result


def _extent(block: NDArray[np.int8]) -> list[NDArray[np.int64]]:
    """First index and one past the last index of what is not zero in a block; nothing for an empty one."""
    filled = [np.flatnonzero(block.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    if not len(filled[0]):
        return []
    return [np.array([indices[0] for indices in filled]), np.array([indices[-1] + 1 for indices in filled])]
