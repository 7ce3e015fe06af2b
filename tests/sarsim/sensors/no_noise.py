"""Sensors without errors."""

from typing import Any

import numpy as np


class NoNoise(np.random.Generator):
    """A random generator whose normal numbers are all 0, so that a sensor's errors are 0."""

    def __init__(self) -> None:
        super().__init__(np.random.PCG64(0))

    def standard_normal(self, size: int | tuple[int, ...] | None = None, *args: Any, **kwargs: Any) -> Any:
        return 0.0 if size is None else np.zeros(size)
