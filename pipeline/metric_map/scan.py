"""What one look says about the voxels around the camera, before it is weighed against what the map knows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

UNSEEN, FREE, HIT = 0, 1, 2
"""Marks of a scan; the kernels use the same numbers."""


@dataclass(frozen=True, eq=False)
class Scan:
    """A box of marks.

    Attributes:
        lower: (3,) int64 voxel index of the box's first voxel.
        marks: (nx, ny, nz) uint8, ``UNSEEN``, ``FREE`` or ``HIT``.
    """

    lower: NDArray[np.int64]
    marks: NDArray[np.uint8]


class Scratch:
    """Memory for the marks of one scan, kept from scan to scan so that no look has to ask the system for it."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._memory = np.zeros(0, np.uint8)

    def zeros(self, shape: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Zeroed flat uint8 marks of a box of this shape, and one more mark that stands for "nowhere".

        Raises:
            InputError: if the box alone exceeds the map's memory bound.
        """
        size = int(shape[0]) * int(shape[1]) * int(shape[2]) + 1
        if size > self._max_bytes:
            raise InputError(f"a scan of {size} voxels exceeds the map's bound of {self._max_bytes} bytes")
        if size > self._memory.size:
            self._memory = np.empty(size, np.uint8)
        self._memory[:size] = 0
        return self._memory[:size]
