"""How large a person is and, as far as the size tells, how the person lies."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

LYING_LENGTH, LYING_HEIGHT = 1.0, 0.5
"""m; a person who is at least so long and no higher lies."""
UPRIGHT_HEIGHT, UPRIGHT_LENGTH = 0.6, 1.4
"""m; a person who is at least so high and no longer sits, kneels or leans."""
OUTLIERS = 1.0
"""Percent of the points at either end of a side that are left out."""


@dataclass(frozen=True)
class Posture:
    """A person's size.

    Attributes:
        length, width: of the smallest upright box around what was seen, the longer side first, m.
        height: of that box, m.
    """

    length: float
    width: float
    height: float

    @property
    def name(self) -> str:
        """How the person lies or sits; empty where the size does not tell."""
        if self.length >= LYING_LENGTH and self.height <= LYING_HEIGHT:
            return "lying"
        if self.height >= UPRIGHT_HEIGHT and self.length <= UPRIGHT_LENGTH:
            return "sitting, kneeling or leaning"
        return ""


def posture_of(points: NDArray[np.float32]) -> Posture:
    """The size of a person of whom (N, 3) points were seen, m."""
    _, _, angle = cv2.minAreaRect(np.ascontiguousarray(points[:, :2], np.float32))
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    sides = np.column_stack([points[:, :2] @ np.array([[c, -s], [s, c]]), points[:, 2]])
    low, high = np.percentile(sides, [OUTLIERS, 100 - OUTLIERS], axis=0)
    one, other, height = (high - low).tolist()
    return Posture(max(one, other), min(one, other), height)
