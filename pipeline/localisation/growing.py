"""Arrays that grow at their end without being copied for every new row."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


class GrowingArray:
    """An array to which rows are appended; its capacity doubles when it is full."""

    def __init__(self, *shape: int, dtype: type[np.generic] = np.float64) -> None:
        """Start without rows; ``shape``: shape of a single row."""
        self._space: NDArray[Any] = np.zeros((16, *shape), dtype)
        self._length = 0

    def __len__(self) -> int:
        return self._length

    @property
    def values(self) -> NDArray[Any]:
        """All rows so far, as a view that can be written to; appending or replacing rows does not change it."""
        return self._space[: self._length]

    @values.setter
    def values(self, rows: ArrayLike) -> None:
        """Replace all rows."""
        self._space = np.array(rows, self._space.dtype)
        self._length = len(self._space)

    def append(self, row: ArrayLike) -> None:
        """Append one row."""
        self.extend(np.asarray(row, self._space.dtype)[None])

    def extend(self, rows: ArrayLike) -> None:
        """Append ``rows``, an array with one more axis than a row."""
        rows = np.asarray(rows, self._space.dtype)
        length = self._length + len(rows)
        if length > len(self._space):
            space = np.zeros((max(length, 2 * len(self._space)), *self._space.shape[1:]), self._space.dtype)
            space[: self._length] = self.values
            self._space = space
        self._space[self._length : length] = rows
        self._length = length
