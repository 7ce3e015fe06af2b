"""A person's size and, as far as the size determines it, posture."""

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Points
from pipeline.rescue_report.config import PostureConfig


@dataclass(frozen=True)
class Posture:
    """A person's size.

    Attributes:
        length, width: sides of the smallest upright box around the person's points, the longer side first, m.
        height: height of this box, m.
        config: how the size determines the posture.
    """

    length: float
    width: float
    height: float
    config: PostureConfig = PostureConfig()

    @property
    def name(self) -> str:
        """How the person lies or sits; empty if the size does not determine it."""
        config = self.config
        if self.length >= max(config.lying_length, config.lying_ratio * self.height):
            return "lying"
        if self.height >= max(config.sitting_height, config.sitting_ratio * self.length):
            return "sitting, kneeling or leaning"
        return ""


def posture_of(points: Points, config: PostureConfig) -> Posture:
    """The size of a person."""
    _, _, angle = cv2.minAreaRect(np.ascontiguousarray(points[:, :2], np.float32))
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    sides = np.column_stack([points[:, :2] @ np.array([[c, -s], [s, c]]), points[:, 2]])
    low, high = np.quantile(sides, [config.outliers, 1 - config.outliers], axis=0)
    one, other, height = (high - low).tolist()
    return Posture(max(one, other), min(one, other), height, config)
