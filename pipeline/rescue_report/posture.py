"""A person's size and, as far as it follows from the size, posture."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

LYING_LENGTH = 1.0
"""m; a person at least this long, and twice as long as high, is lying."""
SITTING_HEIGHT = 0.6
"""m; a person at least this high, and at most half again as long, is sitting, kneeling or leaning."""
OUTLIERS = 0.01
"""Share of the points that are left out at either end of a side."""


@dataclass(frozen=True)
class Posture:
    """A person's size.

    Attributes:
        length, width: of the smallest upright box around the person's points, the longer side first, m.
        height: of that box, m.
    """

    length: float
    width: float
    height: float

    @property
    def name(self) -> str:
        """How the person lies or sits; empty if the size does not determine it."""
        if self.length >= max(LYING_LENGTH, 2 * self.height):
            return "lying"
        if self.height >= max(SITTING_HEIGHT, 2 / 3 * self.length):
            return "sitting, kneeling or leaning"
        return ""


def posture_of(points: NDArray[np.float32]) -> Posture:
    """The size of a person with (N, 3) points, m."""
    _, _, angle = cv2.minAreaRect(np.ascontiguousarray(points[:, :2], np.float32))
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    sides = np.column_stack([points[:, :2] @ np.array([[c, -s], [s, c]]), points[:, 2]])
    low, high = np.quantile(sides, [OUTLIERS, 1 - OUTLIERS], axis=0)
    one, other, height = (high - low).tolist()
    return Posture(max(one, other), min(one, other), height)
