"""A person's size and, as far as it follows from the size, posture."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

LYING_LENGTH, LYING_HEIGHT = 1.0, 0.5
"""m; a person at least this long and at most this high is lying."""
UPRIGHT_HEIGHT, UPRIGHT_LENGTH = 0.6, 1.4
"""m; a person at least this high and at most this long is sitting, kneeling or leaning."""
OUTLIERS = 1.0
"""Percent of the points that are left out at either end of a side."""


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
        if self.length >= LYING_LENGTH and self.height <= LYING_HEIGHT:
            return "lying"
        if self.height >= UPRIGHT_HEIGHT and self.length <= UPRIGHT_LENGTH:
            return "sitting, kneeling or leaning"
        return ""


def posture_of(points: NDArray[np.float32]) -> Posture:
    """The size of a person with (N, 3) points, m."""
    _, _, angle = cv2.minAreaRect(np.ascontiguousarray(points[:, :2], np.float32))
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    sides = np.column_stack([points[:, :2] @ np.array([[c, -s], [s, c]]), points[:, 2]])
    low, high = np.percentile(sides, [OUTLIERS, 100 - OUTLIERS], axis=0)
    one, other, height = (high - low).tolist()
    return Posture(max(one, other), min(one, other), height)
