"""Interquartile means, and their intervals by a bootstrap that is resampled by arena and then by seed.

After Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice" (NeurIPS 2021).
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SHARE = 0.95
"""Share of the resampled means in an interval."""
RESAMPLED = 2000
"""Number of times: an end of the interval is then the 50th value from below or above."""


Mean = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""(...) means of (..., N) values of any unit."""


class Estimate(NamedTuple):
    """A mean and its interval; an interquartile one is infinite where too many episodes did not get there."""

    value: float
    low: float
    high: float


def interquartile_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) means of the middle half of (..., N) values of any unit; a quarter at either end is left out."""
    cut = values.shape[-1] // 4
    middle: NDArray[np.float64] = np.sort(values, axis=-1)[..., cut : values.shape[-1] - cut].mean(axis=-1)
    return middle


def plain_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) means of (..., N) values of any unit."""
    means: NDArray[np.float64] = values.mean(axis=-1)
    return means


def estimate(values: NDArray[np.float64], mean: Mean = interquartile_mean) -> Estimate:
    """The mean of (arenas, seeds) values of any unit, with its interval.

    The seeds of an arena differ only where the method or the robot draws random numbers; else resampling them
    changes nothing.
    """
    means = np.sort(mean(values.ravel()[_drawn(*values.shape)]))
    out = round(RESAMPLED * (1 - SHARE) / 2)
    return Estimate(float(mean(values.ravel())), float(means[out]), float(means[-1 - out]))


@cache
def _drawn(arenas: int, seeds: int) -> NDArray[np.int64]:
    """(RESAMPLED, arenas × seeds) places in flat values: arenas drawn with replacement and, in each, seeds."""
    rng = np.random.default_rng(0)
    arena = rng.integers(arenas, size=(RESAMPLED, arenas, 1))
    seed = rng.integers(seeds, size=(RESAMPLED, arenas, seeds))
    return (arena * seeds + seed).reshape(RESAMPLED, -1)
