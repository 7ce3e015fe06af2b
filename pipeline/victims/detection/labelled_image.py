"""Images with the boxes of the people in them, for training and validation."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class TrainingImage:
    """An image and the people in it.

    Attributes:
        rgb: (H, W, 3) uint8.
        boxes: (N, 4) float32 x0, y0, x1, y1 around the visible part of each person, pixels.
        ignored: (N,) bool: whether so little of a person is visible that a detection is neither right nor wrong.
        shown: (H, W) bool: the pixels that show people; None if unknown.
    """

    rgb: NDArray[np.uint8]
    boxes: NDArray[np.float32]
    ignored: NDArray[np.bool_]
    shown: NDArray[np.bool_] | None = None


class TrainingImages(Protocol):
    """Labelled images that are read one at a time."""

    def __len__(self) -> int:
        """Number of images."""
        ...

    def __getitem__(self, index: int, /) -> TrainingImage:
        """One image."""
        ...

    def people(self, index: int) -> NDArray[np.floating]:
        """(N, 2) widths and heights of the people to be found in one image, as shares of the image's size."""
        ...
