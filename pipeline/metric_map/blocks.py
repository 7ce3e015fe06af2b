"""An unbounded 3D array of int8, stored as cubic blocks that are allocated where values are written."""

from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Cells
from pipeline.errors import InputError

SIDE = 64  # Side of a block, voxels: a multiple of the number that the kernels read and test together

BlockKey = tuple[int, int, int]
VoxelWindow = tuple[slice, slice, slice]


class BlockArray:
    """A 3D array without bounds, which is zero wherever nothing was written.

    It grows by whole blocks of SIDE³ voxels without copying. Finding a block takes one dictionary lookup.
    """

    def __init__(self, max_bytes: int):
        self._max_bytes = max_bytes
        self._blocks: dict[BlockKey, NDArray[np.int8]] = {}

    @property
    def nbytes(self) -> int:
        """Memory of all blocks, bytes."""
        return len(self._blocks) * SIDE**3

    def __contains__(self, key: BlockKey) -> bool:
        """Whether this block exists."""
        return key in self._blocks

    def __getitem__(self, key: BlockKey) -> NDArray[np.int8]:
        """(SIDE, SIDE, SIDE) int8 values of a block: the block itself, not a copy."""
        return self._blocks[key]

    def reserve(self, keys: Iterable[BlockKey]) -> None:
        """Allocate the blocks that do not exist yet.

        Raises:
            InputError: the blocks would exceed the memory limit; none is allocated.
        """
        missing = [key for key in keys if key not in self._blocks]
        if missing and self.nbytes + len(missing) * SIDE**3 > self._max_bytes:
            limit = f"its limit of {self._max_bytes} bytes"
            raise InputError(f"the metric map would exceed {limit}; increase metric_map.max_bytes or voxel_size")
        for key in missing:
            self._blocks[key] = np.zeros((SIDE, SIDE, SIDE), np.int8)

    def items(self) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int8]]]:
        """The blocks in order of their indices: (3,) int64 index of the first voxel, and the block itself."""
        for key in sorted(self._blocks):
            yield np.array(key, np.int64) * SIDE, self._blocks[key]

    def at(self, index: Cells) -> NDArray[np.int8]:
        """(N,) int8 values of voxels with indices (N, 3)."""
        result = np.zeros(len(index), np.int8)
        keys, rest = index // SIDE, np.arange(len(index))
        while len(rest):
            key = keys[rest[0]]
            inside = (keys[rest] == key).all(axis=1)
            if (block := self._blocks.get(tuple(key.tolist()))) is not None:
                result[rest[inside]] = block[tuple((index[rest[inside]] % SIDE).T)]
            rest = rest[~inside]
        return result

    def read(self, lower: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.int8]:
        """An int8 copy of the box with a given first index (3,) and shape."""
        result = np.zeros(shape, np.int8)
        for key, in_box, in_block in block_parts(lower, shape):
            if key in self._blocks:
                result[in_box] = self._blocks[key][in_block]
        return result

    def write(self, lower: NDArray[np.int64], values: NDArray[np.int8]) -> None:
        """Overwrite the box that begins at a (3,) index with (nx, ny, nz) int8 values.

        Raises:
            InputError: the box would exceed the memory limit; nothing is written.
        """
        written = [
            part for part in block_parts(lower, values.shape) if values[part[1]].any() or part[0] in self._blocks
        ]
        self.reserve(key for key, _, _ in written)
        for key, in_box, in_block in written:
            self._blocks[key][in_block] = values[in_box]

    def bounds(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(3,) first and (3,) one past the last index of the box around all non-zero values."""
        corners = [corner + first for first, block in self.items() for corner in _extent(block)]
        if not corners:
            return np.zeros(3, np.int64), np.zeros(3, np.int64)
        return np.min(corners, axis=0), np.max(corners, axis=0)


def block_parts(
    lower: NDArray[np.int64], shape: tuple[int, ...]
) -> Iterator[tuple[BlockKey, VoxelWindow, VoxelWindow]]:
    """Cut a box, given by its first index (3,) and its shape, into one part per block.

    Yields:
        The block's key, and the part's slices in the box and in the block.
    """
    axes = [_axis_parts(first, length) for first, length in zip(lower.tolist(), shape, strict=True)]
    for (a, i, u), (b, j, v), (c, k, w) in product(*axes):
        yield (a, b, c), (i, j, k), (u, v, w)


def _axis_parts(first: int, length: int) -> list[tuple[int, slice, slice]]:
    """The parts along one axis: index of the block, and slices in the box and in the block."""
    result = []
    for block in range(first // SIDE, -(-(first + length) // SIDE)):
        corner = block * SIDE - first
        begin, end = max(corner, 0), min(corner + SIDE, length)
        result.append((block, slice(begin, end), slice(begin - corner, end - corner)))
    return result


def _extent(block: NDArray[np.int8]) -> list[NDArray[np.int64]]:
    """First index and one past the last index of a block's non-zero values; an empty list if there are none."""
    filled = [np.flatnonzero(block.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    if not len(filled[0]):
        return []
    return [np.array([indices[0] for indices in filled]), np.array([indices[-1] + 1 for indices in filled])]
