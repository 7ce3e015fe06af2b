"""Probability that ground expected in view is shown: a Beta distribution for each number of earlier misses."""

import numpy as np

from pipeline.arrays import Values

MOST_MISSES = np.iinfo(np.uint8).max


def chances(shown: Values, missed: Values) -> Values:
    """Probability that ground in view is shown after 0, 1, … misses: the means of the distributions.

    The prior follows Laplace's rule of succession: ground missed k times is shown in one of k + 1 tries, so with
    k / (k + 1) times the probability after k - 1 misses. The run's tries are added to these k + 1. The probability
    without misses stays 1: there may be no ground beyond an outer edge, but there may be behind the next corner.

    Args:
        shown: number of tries that showed ground after 0, 1, … misses.
        missed: number of tries that missed ground again after 0, 1, … misses.
    """
    result = np.ones(len(shown))
    for k in range(1, len(shown)):
        result[k] = (k * result[k - 1] + shown[k]) / (k + 1 + shown[k] + missed[k])
    return result
