"""Whether ground that should be in view shows: a Beta distribution for each number of earlier misses."""

import numpy as np
from numpy.typing import NDArray

MOST_MISSES = np.iinfo(np.uint8).max


class Posterior:
    """What a mission has found of ground that keyframes should have shown.

    Attributes:
        shown: (256,) number of cells that were shown after so many misses.
        missed: (256,) number of cells that were missed once more after so many misses.
    """

    def __init__(self, cells: float):
        """``cells`` side by side count as one try, for they show or hide together."""
        self.shown, self.missed = np.zeros((2, MOST_MISSES + 1), np.int64)
        self._cells = cells

    @property
    def chances(self) -> NDArray[np.float64]:
        """(256,) probability that ground in view shows after 0, 1, … misses: the means of the distributions.

        Prior: by Laplace's rule of succession, what was missed k times shows in one of k + 1 tries, so k / (k + 1)
        times as likely as what was missed once less. To these k + 1 tries come those of the mission. Ground that was
        never missed is certain: beyond a rim there is none, but behind the next corner there may be.
        """
        shown, missed = self.shown / self._cells, self.missed / self._cells
        chances = np.ones(len(shown))
        for k in range(1, len(shown)):
            chances[k] = (k * chances[k - 1] + shown[k]) / (k + 1 + shown[k] + missed[k])
        return chances
