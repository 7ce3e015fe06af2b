"""Images of people for tests: a person is a white box before dark grain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.victims.detection.labelled_image import TrainingImage


@dataclass(frozen=True)
class WhiteBoxes:
    """Images of 64 × 48 pixels; every third one shows no people.

    Attributes:
        count: number of images.
        seed: of the boxes' places.
    """

    count: int
    seed: int = 0

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> TrainingImage:
        rng = np.random.default_rng([self.seed, index])
        rgb = rng.integers(0, 60, (48, 64, 3), np.uint8)
        width, height = (int(extent) for extent in rng.integers((10, 10), (28, 24)))
        x, y = int(rng.integers(0, 64 - width)), int(rng.integers(0, 48 - height))
        if index % 3 == 2:
            return TrainingImage(rgb, np.zeros((0, 4), np.float32), np.zeros(0, bool))
        rgb[y : y + height, x : x + width] = 255
        return TrainingImage(rgb, np.array([[x, y, x + width, y + height]], np.float32), np.zeros(1, bool))

    def people(self, index: int) -> NDArray[np.floating]:
        """(N, 2) widths and heights as shares of the image's."""
        boxes = self[index].boxes
        return (boxes[:, 2:] - boxes[:, :2]) / (64, 48)
