"""Interquartile means, and their intervals by a bootstrap that is resampled by arena and then by seed.

After Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice" (NeurIPS 2021).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SHARE = 0.95
"""Share of the resampled means in an interval."""
RESAMPLED = 2000
"""Number of times: an end of the interval is then the 50th value from below or above."""


class Estimate(NamedTuple):
    """An interquartile mean and its interval; infinite where too many episodes did not get there."""

    value: float
    low: float
    high: float


def interquartile_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) means of the middle half of (..., N) values of any unit; a quarter at either end is left out."""
    cut = values.shape[-1] // 4
    middle: NDArray[np.float64] = np.sort(values, axis=-1)[..., cut : values.shape[-1] - cut].mean(axis=-1)
    return middle


def estimate(values: NDArray[np.float64]) -> Estimate:
    """The interquartile mean of (arenas, seeds) values of any unit, with its interval.

    The seeds of an arena differ only where the method or the robot draws random numbers; else resampling them
    changes nothing.
    """
    rng, (arenas, seeds) = np.random.default_rng(0), values.shape
    arena = rng.integers(arenas, size=(RESAMPLED, arenas, 1))
    drawn = values[arena, rng.integers(seeds, size=(RESAMPLED, arenas, seeds))]
    means = np.sort(interquartile_mean(drawn.reshape(RESAMPLED, -1)))
    out = round(RESAMPLED * (1 - SHARE) / 2)
    return Estimate(float(interquartile_mean(values.ravel())), float(means[out]), float(means[-1 - out]))
