"""Interquartile means, with intervals from a bootstrap that resamples arenas and, within each, seeds.

After Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice" (NeurIPS 2021).
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CONFIDENCE_LEVEL = 0.95
"""Fraction of the resampled means that lie in an interval."""
BOOTSTRAP_SAMPLES = 2000
"""Number of resamples; the ends of an interval are then the 51st lowest and the 51st highest mean."""


Mean = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""A function that returns the (...) means of (..., N) values of any unit."""


class Estimate(NamedTuple):
    """A mean and its interval; an interquartile mean is infinite if more than a quarter of the values are."""

    value: float
    low: float
    high: float


def interquartile_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) means of (..., N) values of any unit, without the lowest and the highest quarter of the values."""
    cut = values.shape[-1] // 4
    middle: NDArray[np.float64] = np.sort(values, axis=-1)[..., cut : values.shape[-1] - cut].mean(axis=-1)
    return middle


def plain_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) means of (..., N) values of any unit."""
    means: NDArray[np.float64] = values.mean(axis=-1)
    return means


def estimate(values: NDArray[np.float64], mean: Mean = interquartile_mean) -> Estimate:
    """The mean of (arenas, seeds) values of any unit, with its interval.

    The values for an arena's seeds differ only if the method or the robot draws random numbers; otherwise, resampling
    the seeds changes nothing.
    """
    means = np.sort(mean(values.ravel()[_resampled_indices(*values.shape)]))
    out = round(BOOTSTRAP_SAMPLES * (1 - CONFIDENCE_LEVEL) / 2)
    return Estimate(float(mean(values.ravel())), float(means[out]), float(means[-1 - out]))


@cache
def _resampled_indices(arenas: int, seeds: int) -> NDArray[np.int64]:
    """(BOOTSTRAP_SAMPLES, arenas × seeds) flat indices of arenas, and seeds in each, drawn with replacement."""
    rng = np.random.default_rng(0)
    arena = rng.integers(arenas, size=(BOOTSTRAP_SAMPLES, arenas, 1))
    seed = rng.integers(seeds, size=(BOOTSTRAP_SAMPLES, arenas, seeds))
    return (arena * seeds + seed).reshape(BOOTSTRAP_SAMPLES, -1)
