"""Sensors without errors."""

from typing import Any

import numpy as np


class NoNoise(np.random.Generator):
    """A generator whose normal numbers are all 0: a sensor that draws its errors from it makes none."""

    def __init__(self) -> None:
        super().__init__(np.random.PCG64(0))

    def standard_normal(self, size: int | tuple[int, ...] | None = None, *args: Any, **kwargs: Any) -> Any:
        return 0.0 if size is None else np.zeros(size)
