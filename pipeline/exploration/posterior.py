"""How likely ground that should be in view is seen: a Beta distribution for each number of earlier misses."""

import numpy as np

from pipeline.arrays import Values

MOST_MISSES = np.iinfo(np.uint8).max


def chances(shown: Values, missed: Values) -> Values:
    """Probability that ground in view shows after 0, 1, … misses: the means of the distributions.

    Prior: by Laplace's rule of succession, what was missed k times shows in one of k + 1 tries, so k / (k + 1) times
    as likely as what was missed once less. To these k + 1 tries come those of the run. Ground that was never missed
    is certain: beyond a rim there is none, but behind the next corner there may be.

    Args:
        shown: number of tries that showed the ground after so many misses.
        missed: number of tries that missed it once more.
    """
    result = np.ones(len(shown))
    for k in range(1, len(shown)):
        result[k] = (k * result[k - 1] + shown[k]) / (k + 1 + shown[k] + missed[k])
    return result
