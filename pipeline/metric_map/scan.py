"""What one look says about the voxels around the sensor, before it is weighed against what the map knows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.metric_map.grid_kernels import box_around
from pipeline.metric_map.projection_kernels import BLOCK


@dataclass(frozen=True, eq=False)
class Scan:
    """A box of marks, which begins and ends at whole multiples of BLOCK voxels.

    Attributes:
        lower: (3,) int64 voxel index of the box's first voxel.
        marks: (nx, ny, nz) uint8: 0 unseen, 1 free, 2 hit.
        flat: the same marks in C order, and one more that stands for "nowhere".
    """

    lower: NDArray[np.int64]
    marks: NDArray[np.uint8]
    flat: NDArray[np.uint8]

    @property
    def words(self) -> NDArray[np.uint64]:
        """(nx, ny, nz / 8) uint64, the marks eight at a time."""
        return self.marks.view(np.uint64)


class Scratch:
    """Memory for the marks of one scan, kept from scan to scan so that no look has to ask the system for it."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = min(max_bytes, 2**31 - 1)  # the kernels count marks in 32 bits
        self._memory = np.zeros(0, np.uint8)

    def scan_around(self, points: NDArray[np.float64]) -> Scan:
        """An empty scan around (N, 3) points in the grid's frame, in voxels, with one to spare for rounding.

        It lives until the next call.

        Raises:
            InputError: if the box alone exceeds the map's memory bound.
        """
        x, y, z, nx, ny, nz = box_around(points, BLOCK)
        size = nx * ny * nz + 1
        if size > self._max_bytes:
            raise InputError(f"a scan of {size} voxels exceeds the map's bound of {self._max_bytes} bytes")
        if size > self._memory.size:
            self._memory = np.empty(size, np.uint8)
        flat = self._memory[:size]
        flat.fill(0)
        return Scan(np.array((x, y, z)), flat[:-1].reshape(nx, ny, nz), flat)
